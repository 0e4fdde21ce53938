/* ---- errors ------------------------------------------------------------------------------------------------------ */

/* What is wrong with a packet (the first ten), or why a message cannot be laid out as one. */
typedef enum {
    SKYLOOP_OK = 0,
    SKYLOOP_BAD_CRC,             /* the CRC-16 is not that of the octets before it */
    SKYLOOP_BAD_VERSION,         /* packet version number not 0, or another format version */
    SKYLOOP_BAD_LENGTH,          /* octets, data length and layout do not agree */
    SKYLOOP_UNKNOWN_APID,        /* none that this end receives */
    SKYLOOP_WRONG_TYPE,          /* the type bit of the other direction */
    SKYLOOP_BAD_HEADER,          /* a header flag that is not in use */
    SKYLOOP_UNKNOWN_OPCODE,      /* no command */
    SKYLOOP_QUATERNION_NOT_UNIT, /* the norm is more than 0.001 off 1 */
    SKYLOOP_NOT_FINITE,          /* a NaN or an infinity in an attitude */
    SKYLOOP_BAD_VALUE,           /* a value that its field does not allow */
    SKYLOOP_BUFFER_TOO_SMALL,    /* the caller's buffer */
    SKYLOOP_TOO_LONG,            /* more than fits one packet or one field */
    SKYLOOP_INCONSISTENT,        /* fields that contradict each other */
    SKYLOOP_NOT_REPRESENTABLE,   /* CAN: a number that no normal f32 is near; send the packet whole, by ISO-TP */
    SKYLOOP_INCOMPLETE           /* CAN: frames of an attitude are missing, or its CRC does not fit */
} skyloop_error_t;

/* What every packet says about itself. */
typedef struct {
    uint16_t apid;           /* kind of the message */
    uint16_t sequence_count; /* count of the packets with this APID, modulo 16384 */
    uint64_t time;           /* units of 2^-32 s since 1958-01-01 TAI */
} skyloop_header_t;

/* ---- checksums --------------------------------------------------------------------------------------------------- */

/* CRC-16/CCITT-FALSE; of "123456789" it is 0x29B1. */
static inline uint16_t skyloop_crc16(const uint8_t *octets, size_t length)
{
    uint32_t crc = 0xFFFFU;
    for (size_t at = 0U; at < length; at++) {
        crc ^= (uint32_t)octets[at] << 8;
        for (unsigned bit = 0U; bit < 8U; bit++) {
            crc = ((crc & 0x8000U) != 0U) ? ((crc << 1) ^ 0x1021U) : (crc << 1);
        }
        crc &= 0xFFFFU;
    }
    return (uint16_t)crc;
}

/* CRC-32 of IEEE 802.3; of "123456789" it is 0xCBF43926. */
static inline uint32_t skyloop_crc32(const uint8_t *octets, size_t length)
{
    uint32_t crc = 0xFFFFFFFFU;
    for (size_t at = 0U; at < length; at++) {
        crc ^= octets[at];
        for (unsigned bit = 0U; bit < 8U; bit++) {
            crc = ((crc & 1U) != 0U) ? ((crc >> 1) ^ 0xEDB88320U) : (crc >> 1);
        }
    }
    return ~crc;
}

/* ---- reading: never past the end; the first error stays ---------------------------------------------------------- */

typedef struct {
    const uint8_t *octets;
    size_t length;
    size_t at;
    skyloop_error_t error;
} skyloop_reader_t;

static inline void skyloop_fail(skyloop_reader_t *reader, skyloop_error_t error)
{
    if (reader->error == SKYLOOP_OK) {
        reader->error = error;
    }
}

static inline uint64_t skyloop_read_unsigned(skyloop_reader_t *reader, size_t octets)
{
    uint64_t value = 0U;
    if ((reader->error != SKYLOOP_OK) || (reader->length - reader->at < octets)) {
        skyloop_fail(reader, SKYLOOP_BAD_LENGTH);
        return 0U;
    }
    for (size_t n = 0U; n < octets; n++) {
        value = (value << 8) | reader->octets[reader->at];
        reader->at++;
    }
    return value;
}

static inline uint8_t skyloop_read_u8(skyloop_reader_t *reader) { return (uint8_t)skyloop_read_unsigned(reader, 1U); }
static inline uint16_t skyloop_read_u16(skyloop_reader_t *reader) { return (uint16_t)skyloop_read_unsigned(reader, 2U); }
static inline uint32_t skyloop_read_u32(skyloop_reader_t *reader) { return (uint32_t)skyloop_read_unsigned(reader, 4U); }
static inline uint64_t skyloop_read_u64(skyloop_reader_t *reader) { return skyloop_read_unsigned(reader, 8U); }

static inline double skyloop_f64(uint64_t bits)
{
    double number;
    (void)memcpy(&number, &bits, sizeof number);
    return number;
}

static inline uint64_t skyloop_f64_bits(double number)
{
    uint64_t bits;
    (void)memcpy(&bits, &number, sizeof bits);
    return bits;
}

static inline float skyloop_f32(uint32_t bits)
{
    float number;
    (void)memcpy(&number, &bits, sizeof number);
    return number;
}

static inline uint32_t skyloop_f32_bits(float number)
{
    uint32_t bits;
    (void)memcpy(&bits, &number, sizeof bits);
    return bits;
}

static inline double skyloop_read_f64(skyloop_reader_t *reader) { return skyloop_f64(skyloop_read_u64(reader)); }
static inline float skyloop_read_f32(skyloop_reader_t *reader) { return skyloop_f32(skyloop_read_u32(reader)); }

static inline void skyloop_read_octets(skyloop_reader_t *reader, uint8_t *out, size_t octets)
{
    for (size_t n = 0U; n < octets; n++) {
        out[n] = skyloop_read_u8(reader);
    }
}

/* All octets that are left: a pointer into the packet. */
static inline const uint8_t *skyloop_read_rest(skyloop_reader_t *reader, size_t *length)
{
    const uint8_t *rest = &reader->octets[reader->at];
    *length = reader->length - reader->at;
    reader->at = reader->length;
    return rest;
}

/* Refuses octets that no field has claimed. */
static inline skyloop_error_t skyloop_read_end(skyloop_reader_t *reader)
{
    if (reader->at != reader->length) {
        skyloop_fail(reader, SKYLOOP_BAD_LENGTH);
    }
    return reader->error;
}

/* ---- writing: never past the buffer; the first error stays ------------------------------------------------------- */

typedef struct {
    uint8_t *octets;
    size_t capacity;
    size_t at;
    skyloop_error_t error;
} skyloop_writer_t;

static inline void skyloop_write_octets(skyloop_writer_t *writer, const uint8_t *octets, size_t length)
{
    if (writer->error != SKYLOOP_OK) {
        return;
    }
    if (length > SKYLOOP_MAX_PACKET - writer->at) {
        writer->error = SKYLOOP_TOO_LONG;
    } else if ((writer->at > writer->capacity) || (length > writer->capacity - writer->at)) {
        writer->error = SKYLOOP_BUFFER_TOO_SMALL;
    } else if (length > 0U) {
        (void)memcpy(&writer->octets[writer->at], octets, length);
        writer->at += length;
    } else {
        /* nothing to write */
    }
}

static inline void skyloop_write_unsigned(skyloop_writer_t *writer, uint64_t value, size_t octets)
{
    uint8_t big_endian[8];
    for (size_t n = 0U; n < octets; n++) {
        big_endian[n] = (uint8_t)(value >> (8U * (octets - 1U - n)));
    }
    skyloop_write_octets(writer, big_endian, octets);
}

static inline void skyloop_write_u8(skyloop_writer_t *writer, uint8_t value) { skyloop_write_unsigned(writer, value, 1U); }
static inline void skyloop_write_u16(skyloop_writer_t *writer, uint16_t value) { skyloop_write_unsigned(writer, value, 2U); }
static inline void skyloop_write_u32(skyloop_writer_t *writer, uint32_t value) { skyloop_write_unsigned(writer, value, 4U); }
static inline void skyloop_write_u64(skyloop_writer_t *writer, uint64_t value) { skyloop_write_unsigned(writer, value, 8U); }

static inline void skyloop_write_f64(skyloop_writer_t *writer, double value)
{
    skyloop_write_u64(writer, skyloop_f64_bits(value));
}

static inline void skyloop_write_f32(skyloop_writer_t *writer, float value)
{
    skyloop_write_u32(writer, skyloop_f32_bits(value));
}

/* ---- values ------------------------------------------------------------------------------------------------------ */

static inline bool skyloop_is_finite(double number)
{
    return ((skyloop_f64_bits(number) >> 52) & 0x7FFU) != 0x7FFU;
}

static inline bool skyloop_is_positive(double number) { return skyloop_is_finite(number) && (number > 0.0); }

/* Whether all octets are whole characters of UTF-8 (Unicode, table 3-7). */
static inline bool skyloop_is_utf8(const uint8_t *text, size_t length)
{
    size_t at = 0U;
    while (at < length) {
        const uint8_t first = text[at];
        uint8_t low = 0x80U;  /* range of the second octet */
        uint8_t high = 0xBFU;
        size_t more = 0U; /* octets after the first */
        if (first < 0x80U) {
            more = 0U;
        } else if ((first >= 0xC2U) && (first <= 0xDFU)) {
            more = 1U;
        } else if ((first >= 0xE0U) && (first <= 0xEFU)) {
            more = 2U;
            low = (first == 0xE0U) ? 0xA0U : low;
            high = (first == 0xEDU) ? 0x9FU : high;
        } else if ((first >= 0xF0U) && (first <= 0xF4U)) {
            more = 3U;
            low = (first == 0xF0U) ? 0x90U : low;
            high = (first == 0xF4U) ? 0x8FU : high;
        } else {
            return false;
        }
        if (more >= length - at) {
            return false;
        }
        for (size_t n = 1U; n <= more; n++) {
            const uint8_t octet = text[at + n];
            if ((octet < low) || (octet > high)) {
                return false;
            }
            low = 0x80U;
            high = 0xBFU;
        }
        at += 1U + more;
    }
    return true;
}

/* ---- pixels ------------------------------------------------------------------------------------------------------ */

/* Octets that `count` pixels take with packing 12 or 16. */
static inline size_t skyloop_packed_length(uint8_t packing, size_t count)
{
    return (packing == 12U) ? (((count / 2U) * 3U) + ((count % 2U) * 2U)) : (count * 2U);
}

/* Most pixels of a PixelBlock. */
static inline size_t skyloop_pixels_per_block(uint8_t packing)
{
    const size_t data = SKYLOOP_MAX_PAYLOAD - 15U;
    return (packing == 12U) ? ((data / 3U) * 2U) : (data / 2U);
}

/* Pixel `index` of packed ones; 0 beyond the last. */
static inline uint16_t skyloop_pixel(uint8_t packing, const uint8_t *data, size_t length, size_t index)
{
    const size_t at = (packing == 12U) ? (((index / 2U) * 3U) + (index % 2U)) : (index * 2U);
    if ((length < 2U) || (at > length - 2U)) {
        return 0U;
    }
    const uint16_t two = (uint16_t)(((uint32_t)data[at] << 8) | data[at + 1U]);
    if (packing != 12U) {
        return two;
    }
    return ((index % 2U) == 0U) ? (uint16_t)(two >> 4) : (uint16_t)(two & 0xFFFU);
}

/* Packs pixels; `capacity` octets are there. */
static inline skyloop_error_t skyloop_pack(uint8_t packing, const uint16_t *pixels, size_t count, uint8_t *data,
                                           size_t capacity)
{
    if (skyloop_packed_length(packing, count) > capacity) {
        return SKYLOOP_BUFFER_TOO_SMALL;
    }
    for (size_t n = 0U; n < count; n++) {
        const uint16_t pixel = pixels[n];
        const size_t at = (packing == 12U) ? (((n / 2U) * 3U) + (n % 2U)) : (n * 2U);
        if ((packing == 12U) && (pixel > 0xFFFU)) {
            return SKYLOOP_BAD_VALUE;
        }
        if (packing != 12U) {
            data[at] = (uint8_t)(pixel >> 8);
            data[at + 1U] = (uint8_t)pixel;
        } else if ((n % 2U) == 0U) {
            data[at] = (uint8_t)(pixel >> 4);
            data[at + 1U] = (uint8_t)(((uint32_t)pixel << 4) & 0xF0U);
        } else {
            data[at] |= (uint8_t)(pixel >> 8);
            data[at + 1U] = (uint8_t)pixel;
        }
    }
    return SKYLOOP_OK;
}

/* Whether the four bits after an odd last pixel of 12 bits are 0. */
static inline bool skyloop_is_padded(uint8_t packing, size_t count, const uint8_t *data, size_t length)
{
    return (packing != 12U) || ((count % 2U) == 0U) || (length == 0U) || ((data[length - 1U] & 0xFU) == 0U);
}

/* ---- compressed pixels: the adaptive Rice coder of CCSDS 121.0-B-3 (docs/icd.md, section 3.14) --------------------- */

typedef struct {
    const uint8_t *data;
    size_t bits; /* of the data */
    size_t at;
} skyloop_bit_reader_t;

/* Bits beyond the end are 0. */
static inline uint32_t skyloop_take_bits(skyloop_bit_reader_t *reader, unsigned count)
{
    uint32_t value = 0U;
    for (unsigned n = 0U; n < count; n++) {
        uint32_t bit = 0U;
        if (reader->at < reader->bits) {
            bit = ((uint32_t)reader->data[reader->at / 8U] >> (7U - (reader->at % 8U))) & 1U;
        }
        value = (value << 1) | bit;
        reader->at++;
    }
    return value;
}

/* The zeros before the next 1, which is taken too. Where there is none, the place is beyond the end. */
static inline uint32_t skyloop_take_zeros(skyloop_bit_reader_t *reader)
{
    uint32_t zeros = 0U;
    while ((zeros < 0x10000U) && (reader->at < reader->bits)) {
        if (skyloop_take_bits(reader, 1U) == 1U) {
            return zeros;
        }
        zeros++;
    }
    reader->at = reader->bits + 1U;
    return 0U;
}

/* The pixel of a mapped sample after the pixel `last`. */
static inline uint16_t skyloop_unmap(uint32_t last, uint32_t sample, uint32_t most)
{
    const uint32_t side = (last < most - last) ? last : (most - last);
    uint32_t pixel = last + (sample / 2U);
    if (sample > 2U * side) {
        pixel = (last == side) ? sample : (most - sample);
    } else if ((sample % 2U) == 1U) {
        pixel = last - ((sample + 1U) / 2U);
    } else {
        /* above the last */
    }
    return (uint16_t)pixel;
}

/* The `count` pixels of a Compressed packet's data; `bits` is that of the FrameHeader. */
static inline skyloop_error_t skyloop_decompress(const uint8_t *data, size_t length, uint8_t bits, uint16_t *pixels,
                                                 size_t count)
{
    if ((bits < 1U) || (bits > 16U)) {
        return SKYLOOP_BAD_VALUE;
    }
    skyloop_bit_reader_t reader = {data, length * 8U, 0U};
    const uint32_t most = ((uint32_t)1U << bits) - 1U;
    const unsigned option_bits = (bits <= 8U) ? 3U : 4U;
    const uint32_t uncompressed = ((uint32_t)1U << option_bits) - 1U;
    for (size_t first = 0U; first < count; first += 16U) {
        uint32_t samples[16] = {0U};
        const uint32_t option = skyloop_take_bits(&reader, option_bits);
        const unsigned low = (option == uncompressed) ? bits : (unsigned)(option - 1U);
        const size_t reference = (first == 0U) ? 1U : 0U;
        if (option == 0U) {
            return SKYLOOP_BAD_VALUE;
        }
        if (reference == 1U) {
            samples[0] = skyloop_take_bits(&reader, bits);
        }
        for (size_t n = reference; (option != uncompressed) && (n < 16U); n++) {
            samples[n] = skyloop_take_zeros(&reader);
        }
        for (size_t n = reference; n < 16U; n++) {
            const uint32_t sample = (samples[n] << low) | skyloop_take_bits(&reader, low);
            const size_t place = first + n;
            samples[n] = sample;
            if ((sample > most) || (reader.at > reader.bits) ||
                ((place >= count) && (sample != 0U))) {
                return SKYLOOP_BAD_VALUE;
            }
        }
        for (size_t n = 0U; (n < 16U) && (first + n < count); n++) {
            const size_t place = first + n;
            pixels[place] = (place == 0U) ? (uint16_t)samples[0] : skyloop_unmap(pixels[place - 1U], samples[n], most);
        }
    }
    const size_t unused = reader.bits - ((reader.at < reader.bits) ? reader.at : reader.bits);
    return ((unused < 8U) && (skyloop_take_bits(&reader, (unsigned)unused) == 0U)) ? SKYLOOP_OK : SKYLOOP_BAD_VALUE;
}

/* ---- serial lines: RFC 1055 around packet and CRC-32 ------------------------------------------------------------- */

/* Most octets that a frame of a packet of `length` octets has. */
#define SKYLOOP_SLIP_MAX(length) ((2U * ((length) + 4U)) + 2U)

static inline bool skyloop_slip_put(uint8_t octet, uint8_t *line, size_t capacity, size_t *at)
{
    const bool escaped = (octet == 0xC0U) || (octet == 0xDBU);
    if (capacity - *at < (escaped ? 2U : 1U)) {
        return false;
    }
    if (escaped) {
        line[*at] = 0xDBU;
        *at += 1U;
        line[*at] = (octet == 0xC0U) ? 0xDCU : 0xDDU;
    } else {
        line[*at] = octet;
    }
    *at += 1U;
    return true;
}

static inline skyloop_error_t skyloop_slip_encode(const uint8_t *packet, size_t length, uint8_t *line, size_t capacity,
                                                  size_t *line_length)
{
    const uint32_t crc = skyloop_crc32(packet, length);
    size_t at = 1U;
    bool fits = capacity >= 2U;
    if (fits) {
        line[0] = 0xC0U;
    }
    for (size_t n = 0U; fits && (n < length); n++) {
        fits = skyloop_slip_put(packet[n], line, capacity, &at);
    }
    for (unsigned n = 0U; fits && (n < 4U); n++) {
        fits = skyloop_slip_put((uint8_t)(crc >> (24U - (8U * n))), line, capacity, &at);
    }
    if ((!fits) || (at >= capacity)) {
        return SKYLOOP_BUFFER_TOO_SMALL;
    }
    line[at] = 0xC0U;
    *line_length = at + 1U;
    return SKYLOOP_OK;
}

/* A receiver: give it every octet of the line. */
typedef struct {
    uint8_t octets[SKYLOOP_MAX_PACKET + 4U];
    size_t length;
    bool escaped;
    bool broken;
    uint32_t errors; /* frames thrown away, modulo 2^32 */
} skyloop_slip_t;

static inline void skyloop_slip_begin(skyloop_slip_t *slip)
{
    slip->length = 0U;
    slip->escaped = false;
    slip->broken = false;
    slip->errors = 0U;
}

/* True when `octets` holds a packet of `*packet_length` octets, until the next call. */
static inline bool skyloop_slip_push(skyloop_slip_t *slip, uint8_t octet, size_t *packet_length)
{
    if (octet == 0xC0U) {
        const size_t length = slip->length;
        const bool whole = (!slip->broken) && (!slip->escaped) && (length > 4U);
        const bool empty = (!slip->broken) && (!slip->escaped) && (length == 0U);
        slip->length = 0U;
        slip->escaped = false;
        slip->broken = false;
        if (whole) {
            const uint8_t *crc = &slip->octets[length - 4U];
            const uint32_t found = ((uint32_t)crc[0] << 24) | ((uint32_t)crc[1] << 16) | ((uint32_t)crc[2] << 8) | crc[3];
            if (skyloop_crc32(slip->octets, length - 4U) == found) {
                *packet_length = length - 4U;
                return true;
            }
        }
        slip->errors += empty ? 0U : 1U;
    } else if (slip->broken) {
        /* skipped up to the next END */
    } else if ((octet == 0xDBU) && (!slip->escaped)) {
        slip->escaped = true;
    } else if ((slip->escaped && (octet != 0xDCU) && (octet != 0xDDU)) || (slip->length >= sizeof slip->octets)) {
        slip->broken = true;
    } else {
        const uint8_t unescaped = (octet == 0xDCU) ? 0xC0U : 0xDBU;
        slip->octets[slip->length] = slip->escaped ? unescaped : octet;
        slip->length++;
        slip->escaped = false;
    }
    return false;
}
