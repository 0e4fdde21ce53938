/* Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
 *
 * The native packets of skyloop, format version 3: docs/icd.md describes every octet. C99, no allocation, no state.
 *
 * Towards the emulator: skyloop_encode_uplink, skyloop_decode_uplink; from it: skyloop_decode_downlink,
 * skyloop_encode_downlink. On serial lines skyloop_slip_*, on CAN skyloop_can_*. What decoders hand over as a pointer
 * points into the packet.
 */
#ifndef SKYLOOP_H
#define SKYLOOP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define SKYLOOP_VERSION 3U
#define SKYLOOP_MAX_PACKET 1400U
#define SKYLOOP_HEADER_LENGTH 15U
#define SKYLOOP_MAX_PAYLOAD (SKYLOOP_MAX_PACKET - SKYLOOP_HEADER_LENGTH - 2U)

/* Kinds of packets. */
#define SKYLOOP_APID_ATTITUDE 0x101U /* Attitude of the body at the time in the header; in stepped mode that is the middle of the exposure. */
#define SKYLOOP_APID_COMMAND 0x102U /* Everything else that a client says, by opcode. */
#define SKYLOOP_APID_FRAME_HEADER 0x201U /* Opens a frame. */
#define SKYLOOP_APID_PIXEL_BLOCK 0x202U /* A run of pixels. */
#define SKYLOOP_APID_LABELS 0x203U /* A part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without its last member `files` and without a newline. */
#define SKYLOOP_APID_STATUS 0x204U /* Settings and counters, sent after the Ack of a Ping. */
#define SKYLOOP_APID_ACK 0x205U /* A command was carried out. */
#define SKYLOOP_APID_NACK 0x206U /* A packet was refused. */
#define SKYLOOP_APID_WINDOWS 0x207U /* Square windows cut out of a frame. */
#define SKYLOOP_APID_OBJECTS 0x208U /* Records of the brightest objects in a frame, brightest first. */
#define SKYLOOP_APID_COMPRESSED 0x209U /* A run of pixels, losslessly compressed. */
#define SKYLOOP_APID_FRAME_END 0x20AU /* Closes a frame: what is known only when all of it has been rendered and sent. */
#define SKYLOOP_APID_CHALLENGE 0x20BU /* UDP: asks the client to prove its address by sending this packet back as it came (section 5.1). */

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

/* ---- codes ------------------------------------------------------------------------------------------------------- */

/* What makes the emulator take a frame. */
#define SKYLOOP_MODE_STEPPED 0U /* One frame for every attitude. */
#define SKYLOOP_MODE_WALL 1U /* The camera's cadence by the wall clock, with the latest attitude. */
#define SKYLOOP_MODE_EXTERNAL 2U /* Exposures by the client's time. */

static inline bool skyloop_is_mode(uint8_t code)
{
    return (code == SKYLOOP_MODE_STEPPED) ||
           (code == SKYLOOP_MODE_WALL) ||
           (code == SKYLOOP_MODE_EXTERNAL);
}

/* Which pixels of a frame are sent. */
#define SKYLOOP_PIXEL_LEVEL_NONE 0U /* No pixels: the header, and what labels there are. */
#define SKYLOOP_PIXEL_LEVEL_WINDOWS 1U /* Square windows around the brightest stars or around listed positions. */
#define SKYLOOP_PIXEL_LEVEL_FRAME 2U /* Every pixel. */
#define SKYLOOP_PIXEL_LEVEL_COMPRESSED 3U /* Every pixel, losslessly compressed. */

static inline bool skyloop_is_pixel_level(uint8_t code)
{
    return (code == SKYLOOP_PIXEL_LEVEL_NONE) ||
           (code == SKYLOOP_PIXEL_LEVEL_WINDOWS) ||
           (code == SKYLOOP_PIXEL_LEVEL_FRAME) ||
           (code == SKYLOOP_PIXEL_LEVEL_COMPRESSED);
}

/* Which labels of a frame are sent. */
#define SKYLOOP_LABEL_LEVEL_NONE 0U /* No labels. */
#define SKYLOOP_LABEL_LEVEL_OBJECTS 1U /* A record of fixed size for each of the brightest objects in the frame. */
#define SKYLOOP_LABEL_LEVEL_TEXT 2U /* All of them: the frame's line of `labels.jsonl`, without `files`. */

static inline bool skyloop_is_label_level(uint8_t code)
{
    return (code == SKYLOOP_LABEL_LEVEL_NONE) ||
           (code == SKYLOOP_LABEL_LEVEL_OBJECTS) ||
           (code == SKYLOOP_LABEL_LEVEL_TEXT);
}

/* How pixels are laid out; the code is the number of bits that a pixel takes. */
#define SKYLOOP_PACKING_BITS12 12U /* Two pixels in three octets, first bit first. */
#define SKYLOOP_PACKING_BITS16 16U /* Two octets a pixel, big-endian. */

static inline bool skyloop_is_packing(uint8_t code)
{
    return (code == SKYLOOP_PACKING_BITS12) ||
           (code == SKYLOOP_PACKING_BITS16);
}

/* What the attitude that a frame shows was made of. */
#define SKYLOOP_ATTITUDE_SOURCE_EXACT 0U /* An attitude whose own time is the middle of the exposure. */
#define SKYLOOP_ATTITUDE_SOURCE_INTERPOLATED 1U /* Two attitudes, between them. */
#define SKYLOOP_ATTITUDE_SOURCE_EXTRAPOLATED 2U /* One attitude, carried on by its rates. */
#define SKYLOOP_ATTITUDE_SOURCE_HELD 3U /* A stale one: carried on to the limit of its age, and held there. */
#define SKYLOOP_ATTITUDE_SOURCE_STALE 4U /* One older than the limit, carried on all the same. */
#define SKYLOOP_ATTITUDE_SOURCE_INVALID 5U /* A stale one, and marked so: what is shown means nothing. */
#define SKYLOOP_ATTITUDE_SOURCE_FUTURE 6U /* One whose time lies after the exposure, carried back. */

static inline bool skyloop_is_attitude_source(uint8_t code)
{
    return (code == SKYLOOP_ATTITUDE_SOURCE_EXACT) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_INTERPOLATED) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_EXTRAPOLATED) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_HELD) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_STALE) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_INVALID) ||
           (code == SKYLOOP_ATTITUDE_SOURCE_FUTURE);
}

/* What was done about a frame that would be late. */
#define SKYLOOP_OVERRUN_NONE 0U /* Nothing: it was not expected to be. */
#define SKYLOOP_OVERRUN_LATE 1U /* It is late, foreseen or not. */
#define SKYLOOP_OVERRUN_DROP 2U /* The first frame after exposures that were left out. */
#define SKYLOOP_OVERRUN_COARSEN 3U /* It was rendered by coarser tolerances. */

static inline bool skyloop_is_overrun(uint8_t code)
{
    return (code == SKYLOOP_OVERRUN_NONE) ||
           (code == SKYLOOP_OVERRUN_LATE) ||
           (code == SKYLOOP_OVERRUN_DROP) ||
           (code == SKYLOOP_OVERRUN_COARSEN);
}

/* What the emulator goes by for the client's time. */
#define SKYLOOP_SYNC_STATE_FREE 0U /* Nothing: it keeps its own time. */
#define SKYLOOP_SYNC_STATE_WAITING 1U /* Nothing heard of the client's time yet. */
#define SKYLOOP_SYNC_STATE_LOCKED 2U /* Follows the client's time. */
#define SKYLOOP_SYNC_STATE_HOLDOVER 3U /* Nothing heard for a while: runs on by its own. */
#define SKYLOOP_SYNC_STATE_PAUSED 4U /* Nothing: Pause has stopped the scene's time. */

static inline bool skyloop_is_sync_state(uint8_t code)
{
    return (code == SKYLOOP_SYNC_STATE_FREE) ||
           (code == SKYLOOP_SYNC_STATE_WAITING) ||
           (code == SKYLOOP_SYNC_STATE_LOCKED) ||
           (code == SKYLOOP_SYNC_STATE_HOLDOVER) ||
           (code == SKYLOOP_SYNC_STATE_PAUSED);
}

/* Why the client has not received the whole last frame. */
#define SKYLOOP_WITHHELD_NONE 0U /* It has, or there was no frame. */
#define SKYLOOP_WITHHELD_NO_CREDIT 1U /* The frame has more packets than Credit grants: send `packets = received + window` after every few frame packets. */
#define SKYLOOP_WITHHELD_NOT_READ 2U /* The link has had no room for 2 s: the client does not read. */
#define SKYLOOP_WITHHELD_SLOW_LINK 3U /* A frame takes longer on the link than there is time: ask for less with Output, or use a faster link. */
#define SKYLOOP_WITHHELD_NO_PROOF 4U /* UDP: the client has not returned the Challenge: send it back as it came. */
#define SKYLOOP_WITHHELD_LOST 5U /* Packets got lost on the way: the client grants less than was sent, or asks for packets again. Enlarge its receive buffer (SO_RCVBUF), grant less, or limit the link (`rate_mbit`). */
#define SKYLOOP_WITHHELD_TOO_LONG 6U /* The frame cannot be encoded, such as a label text longer than 65,535 packets: ask for other labels. */
#define SKYLOOP_WITHHELD_REFUSED 7U /* The attitude or Trigger was refused, or could not be decoded: a Nack says why. */
#define SKYLOOP_WITHHELD_NO_CLIENT 8U /* No valid packet has come on this link, or its client has gone. */
#define SKYLOOP_WITHHELD_NO_TRIGGER 9U /* Attitudes come and no Trigger, and `run.trigger` is `packet`: send Triggers, or set `run.trigger` to `own`. */

static inline bool skyloop_is_withheld(uint8_t code)
{
    return (code == SKYLOOP_WITHHELD_NONE) ||
           (code == SKYLOOP_WITHHELD_NO_CREDIT) ||
           (code == SKYLOOP_WITHHELD_NOT_READ) ||
           (code == SKYLOOP_WITHHELD_SLOW_LINK) ||
           (code == SKYLOOP_WITHHELD_NO_PROOF) ||
           (code == SKYLOOP_WITHHELD_LOST) ||
           (code == SKYLOOP_WITHHELD_TOO_LONG) ||
           (code == SKYLOOP_WITHHELD_REFUSED) ||
           (code == SKYLOOP_WITHHELD_NO_CLIENT) ||
           (code == SKYLOOP_WITHHELD_NO_TRIGGER);
}

/* What goes wrong on the link. */
#define SKYLOOP_FAULT_KIND_BIT_FLIPS 1U /* Bits are flipped; value: probability of each bit. */
#define SKYLOOP_FAULT_KIND_DROP 2U /* Packets are lost; value: probability of each. */
#define SKYLOOP_FAULT_KIND_DUPLICATE 3U /* Packets come twice; value: probability of each. */
#define SKYLOOP_FAULT_KIND_REORDER 4U /* A packet comes after the next one; value: probability of each. */
#define SKYLOOP_FAULT_KIND_TRUNCATE 5U /* Packets are cut short; value: probability of each. */
#define SKYLOOP_FAULT_KIND_DELAY 6U /* Everything comes later; value: s. */
#define SKYLOOP_FAULT_KIND_JITTER 7U /* Everything comes later by a random time; value: the longest, s. */
#define SKYLOOP_FAULT_KIND_STUCK 8U /* Nothing passes and no error is reported; value: 1 on, 0 off. */
#define SKYLOOP_FAULT_KIND_DOWN 9U /* The link is down; value: 1 on, 0 off. */
#define SKYLOOP_FAULT_KIND_OVERRUN 10U /* The receiver throws packets away; value: probability of each. */
#define SKYLOOP_FAULT_KIND_BUS_OFF 11U /* CAN: the controller leaves the bus; value: 1 on, 0 off. */

static inline bool skyloop_is_fault_kind(uint8_t code)
{
    return (code == SKYLOOP_FAULT_KIND_BIT_FLIPS) ||
           (code == SKYLOOP_FAULT_KIND_DROP) ||
           (code == SKYLOOP_FAULT_KIND_DUPLICATE) ||
           (code == SKYLOOP_FAULT_KIND_REORDER) ||
           (code == SKYLOOP_FAULT_KIND_TRUNCATE) ||
           (code == SKYLOOP_FAULT_KIND_DELAY) ||
           (code == SKYLOOP_FAULT_KIND_JITTER) ||
           (code == SKYLOOP_FAULT_KIND_STUCK) ||
           (code == SKYLOOP_FAULT_KIND_DOWN) ||
           (code == SKYLOOP_FAULT_KIND_OVERRUN) ||
           (code == SKYLOOP_FAULT_KIND_BUS_OFF);
}

/* Which way packets go. */
#define SKYLOOP_DIRECTION_IN 0U /* From the client to the emulator. */
#define SKYLOOP_DIRECTION_OUT 1U /* From the emulator to the client. */

static inline bool skyloop_is_direction(uint8_t code)
{
    return (code == SKYLOOP_DIRECTION_IN) ||
           (code == SKYLOOP_DIRECTION_OUT);
}

/* Why the emulator refuses a packet: the reason octet of a `Nack`. */
#define SKYLOOP_REASON_BAD_CRC 1U /* The CRC does not fit the octets before it. */
#define SKYLOOP_REASON_BAD_VERSION 2U /* Packet version number not 0, or format version not 3. */
#define SKYLOOP_REASON_BAD_LENGTH 3U /* Octets, data length and layout do not agree. */
#define SKYLOOP_REASON_UNKNOWN_TYPE 4U /* Unknown APID, opcode or header flag, or the type bit of the other direction. */
#define SKYLOOP_REASON_QUATERNION_NOT_UNIT 5U /* The norm is more than 0.001 off 1. */
#define SKYLOOP_REASON_NOT_FINITE 6U /* A NaN or an infinity in an attitude. */
#define SKYLOOP_REASON_TIME_BACKWARDS 7U /* Earlier than the last attitude accepted. */
#define SKYLOOP_REASON_VALUE_OUT_OF_RANGE 8U /* Outside what the field, the camera or the observer allows. */
#define SKYLOOP_REASON_BUSY 9U /* Cannot be taken now; send it again later. */
#define SKYLOOP_REASON_NOT_SUPPORTED 10U /* This emulator or its present mode does not have it. */

static inline bool skyloop_is_reason(uint8_t code)
{
    return (code == SKYLOOP_REASON_BAD_CRC) ||
           (code == SKYLOOP_REASON_BAD_VERSION) ||
           (code == SKYLOOP_REASON_BAD_LENGTH) ||
           (code == SKYLOOP_REASON_UNKNOWN_TYPE) ||
           (code == SKYLOOP_REASON_QUATERNION_NOT_UNIT) ||
           (code == SKYLOOP_REASON_NOT_FINITE) ||
           (code == SKYLOOP_REASON_TIME_BACKWARDS) ||
           (code == SKYLOOP_REASON_VALUE_OUT_OF_RANGE) ||
           (code == SKYLOOP_REASON_BUSY) ||
           (code == SKYLOOP_REASON_NOT_SUPPORTED);
}

/* What a Command asks for. */
#define SKYLOOP_OPCODE_EXPOSURE 1U /* Exposure time of the attitudes that follow (stepped), of the next frames (wall). */
#define SKYLOOP_OPCODE_GAIN 2U /* Conversion gain, likewise. */
#define SKYLOOP_OPCODE_FRAME_RATE 3U /* By the wall and the external clock: cadence from now on; lets frames run again after SingleShot. */
#define SKYLOOP_OPCODE_SINGLE_SHOT 4U /* By the wall and the external clock: one frame with the latest attitude, then the cadence rests until FrameRate. */
#define SKYLOOP_OPCODE_RESET 5U /* Configured settings, frames under way abandoned, exchange as new (section 5). */
#define SKYLOOP_OPCODE_PING 6U /* Answered by Ack, then Status. */
#define SKYLOOP_OPCODE_CREDIT 7U /* Pacing, section 5.3. */
#define SKYLOOP_OPCODE_OUTPUT 8U /* What each frame from now on brings. */
#define SKYLOOP_OPCODE_POSITIONS 9U /* Where the windows are from now on. */
#define SKYLOOP_OPCODE_RESEND 10U /* Packets of one of the last frames once more, as they were; they take no credit. */
#define SKYLOOP_OPCODE_FAULT 11U /* Something goes wrong on this link, on purpose. */
#define SKYLOOP_OPCODE_TRIGGER 12U /* One exposure at a time that the client chooses; answered by its frame. */
#define SKYLOOP_OPCODE_PAUSE 13U /* No exposure ends and the scene's time stands still until Resume; section 5.10. */
#define SKYLOOP_OPCODE_RESUME 14U /* Exposures and the scene's time go on after Pause. */

/* ---- messages ---------------------------------------------------------------------------------------------------- */

/* What each frame from now on brings. */
typedef struct {
    uint8_t pixels; /* Which pixels */
    uint8_t labels; /* Which labels */
    uint8_t window_size; /* Columns and rows of a window [px] */
    uint8_t windows; /* Windows around so many of the brightest stars */
    uint16_t objects; /* Records of so many of the brightest objects */
} skyloop_output_t;
#define SKYLOOP_OUTPUT_LENGTH 6U

/* Centres of the windows, instead of the brightest stars. */
typedef struct {
    uint8_t count; /* Number of positions; 0: around the brightest again */
    uint16_t at[64][2]; /* Centres of the windows: column, row [px] */
} skyloop_positions_t;

/* One fault of one direction, from now on. */
typedef struct {
    uint8_t kind; /* What goes wrong */
    uint8_t direction; /* Which way */
    double value; /* How much, as the kind says: a probability, a time, 1 or 0; 0 ends the fault */
    double seconds; /* For how long; 0: until it is changed [s] */
} skyloop_fault_t;
#define SKYLOOP_FAULT_LENGTH 18U

/* One object of the labels. */
typedef struct {
    bool is_rso; /* 0: a star; 1: a resident space object */
    bool in_frame; /* 1: its centroid is in the frame; 2: it is in the frame, lit, not occulted and bright enough */
    bool visible; /* 1: its centroid is in the frame; 2: it is in the frame, lit, not occulted and bright enough */
    uint8_t id[16]; /* Its `id` in ASCII, zeros after it; cut if longer */
    double x_px; /* Column of its centroid [px] */
    double y_px; /* Row of its centroid [px] */
    float dx_px; /* Columns that its image moves during the exposure [px] */
    float dy_px; /* Rows that its image moves during the exposure [px] */
    float mag; /* Its magnitude [mag] */
    float snr; /* Signal-to-noise ratio */
    float electrons; /* Electrons on the detector [e-] */
} skyloop_object_record_t;
#define SKYLOOP_OBJECT_RECORD_LENGTH 54U

/* When a frame's attitude held, its pixels were ready and its packets left; by the stepped clock all but the attitude's age is 0. */
typedef struct {
    float attitude_age_s; /* Middle of the exposure minus the time of the attitude; below 0: it is of the future [s] */
    float first_pixel_s; /* From the trigger (the exposure's end, or the attitude's arrival if that is later) until the first pixel was ready [s] */
    float last_pixel_s; /* From the trigger until the last pixel was ready [s] */
    float first_octet_s; /* From the trigger until the FrameHeader was handed to the link [s] */
    float last_octet_s; /* From the trigger until the packet before FrameEnd was handed to the link [s] */
    float spare_s; /* Time left until the deadline when FrameEnd was handed to the link, less what waits before it on a line of known pace; below 0: late by so much [s] */
} skyloop_timing_t;
#define SKYLOOP_TIMING_LENGTH 24U

/* Attitude of the body at the time in the header; in stepped mode that is the middle of the exposure. */
typedef struct {
    uint32_t sequence; /* The client's number of this attitude; keys the noise of its frame and returns in FrameHeader */
    double q_icrf_to_body[4]; /* Attitude x, y, z, w, ICRF to body (section 1); the emulator normalises it */
    double rates_rad_s[3]; /* Body rates [rad/s] */
    bool has_state; /* whether the members below hold anything */
    double position_m[3]; /* GCRF position, with flags 1 only [m] */
    double velocity_m_s[3]; /* GCRF velocity, with flags 1 only [m/s] */
} skyloop_attitude_t;

/* Everything else that a client says, by opcode. */
typedef struct {
    uint8_t opcode; /* SKYLOOP_OPCODE_... */
    union {
        struct {
            double seconds; /* Exposure time [s] */
        } exposure;
        struct {
            double e_per_dn; /* Electrons per digital number [e-/DN] */
        } gain;
        struct {
            double hz; /* Frames a second [Hz] */
        } frame_rate;
        struct {
            uint32_t packets; /* How many frame packets the client can take since the exchange opened or was Reset: cumulative, modulo 2^32 [packets] */
        } credit;
        skyloop_output_t output;
        skyloop_positions_t positions;
        struct {
            uint32_t frame; /* Which frame */
            uint32_t first; /* Number of the first packet in its frame: 0 is the FrameHeader */
            uint32_t count; /* How many packets [packets] */
        } resend;
        skyloop_fault_t fault;
        struct {
            uint32_t number; /* The client's number of this trigger; returns in FrameEnd */
            uint64_t start; /* First instant of the exposure */
        } trigger;
    } as; /* by opcode; those that are not here have no argument */
} skyloop_command_t;

/* Opens a frame. */
typedef struct {
    uint32_t frame; /* Number of the frame since the emulator started */
    uint32_t attitude_sequence; /* `sequence` of the attitude that it shows */
    uint16_t width; /* Columns [px] */
    uint16_t height; /* Rows [px] */
    uint8_t bits; /* Bits of a digital number [bit] */
    uint8_t packing; /* Bits that a pixel takes in PixelBlock and Windows [bit] */
    uint8_t pixel_level; /* Which of its pixels follow */
    uint8_t label_level; /* Which of its labels follow them */
    uint8_t window_size; /* Columns and rows of a window; 0 without windows [px] */
    uint16_t windows; /* Number of windows; 0 without */
    uint32_t blocks; /* Packets with pixels that follow: PixelBlock, Windows or Compressed */
    uint16_t label_parts; /* Packets with labels that follow them: Labels or Objects */
    uint32_t label_bytes; /* Length of the label text or of all object records; 0: no labels [octets] */
    uint64_t exposure_start; /* First instant of the exposure */
    uint64_t exposure_end; /* Last instant of the exposure */
    uint64_t seed; /* Seed of the noise */
    double gain_e_per_dn; /* Conversion gain [e-/DN] */
    double offset_dn; /* Digital number of a pixel without any electrons [DN] */
} skyloop_frame_header_t;

/* A run of pixels. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint32_t index; /* Number of the block in its frame */
    uint32_t first_pixel; /* Place of its first pixel */
    uint16_t count; /* Number of its pixels; every block but the last is full [px] */
    uint8_t packing; /* Bits that a pixel takes [bit] */
    const uint8_t *data; /* The pixels [DN] */
    size_t data_length; /* its octets */
} skyloop_pixel_block_t;

/* A part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without its last member `files` and without a newline. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint16_t part; /* Number of the part; its text begins at octet part * 1375 of the whole */
    uint16_t parts; /* As label_parts */
    const uint8_t *text; /* 1375 octets, fewer in the last part only */
    size_t text_length; /* its octets */
} skyloop_label_part_t;

/* Settings and counters, sent after the Ack of a Ping. */
typedef struct {
    uint8_t mode; /* What makes the emulator take a frame */
    uint16_t width; /* Columns of the camera [px] */
    uint16_t height; /* Rows of the camera [px] */
    uint8_t bits; /* Bits of a digital number [bit] */
    uint8_t packing; /* Bits that a pixel takes in PixelBlock and Windows [bit] */
    skyloop_output_t output; /* What each frame brings */
    double exposure_s; /* Exposure time [s] */
    double gain_e_per_dn; /* Conversion gain [e-/DN] */
    double frame_rate_hz; /* Cadence by the wall and the external clock [Hz] */
    uint32_t next_frame; /* Number that the next frame will have */
    uint32_t packets_sent; /* Frame packets sent in this exchange, modulo 2^32 [packets] */
    uint8_t sync; /* What it goes by for the client's time */
    double clock_offset_s; /* As in FrameEnd, at present [s] */
    uint64_t exposure_start; /* First instant of the exposure of the last frame that left; 0 before */
    uint64_t exposure_end; /* Its last instant; its middle lies halfway */
    skyloop_timing_t timing; /* Of that frame, on this link; all 0 before */
    float latency_p50_s; /* From the trigger until a frame's last octet left, half of the run's frames in this time; 0 before the first [s] */
    float latency_p99_s; /* The same for 99 of 100 frames [s] */
    float latency_max_s; /* The same for all [s] */
    uint8_t withheld; /* Why the client has not received the whole last frame */
    uint32_t attitudes; /* Attitudes accepted */
    uint32_t commands; /* Commands accepted, Credit included */
    uint32_t frames_rendered; /* Frames rendered */
    uint32_t frames_delivered; /* Frames whose last packet was handed to the link */
    uint32_t frames_abandoned; /* Frames abandoned before their last packet */
    uint32_t bad_crc; /* Packets with a wrong CRC-16, serial frames with a wrong CRC-32 */
    uint32_t bad_version; /* Packets of another version */
    uint32_t bad_length; /* Packets of a wrong length */
    uint32_t unknown_type; /* Packets with an unknown APID, opcode, type bit or header flag */
    uint32_t bad_framing; /* Serial frames with a bad escape, invalid lines of a CAN adapter, invalid CAN frames with skyloop's identifiers (section 4.4) */
    uint32_t bad_attitude; /* Attitudes whose quaternion is not of unit length or that hold a NaN or an infinity */
    uint32_t time_backwards; /* Attitudes earlier than the last one accepted: refused, or used where the emulator is configured so */
    uint32_t foreign_packets; /* Packets from others than the client of the exchange */
    uint32_t overflows; /* Packets (on a CAN bus: frames) dropped because the receive queue was full */
    uint32_t bad_value; /* Packets with a value out of range */
    uint32_t refused; /* Valid packets refused as Busy or NotSupported */
    uint32_t sequence_gaps; /* Packets missing in the client's sequence counts when a later one arrived; packets that arrive late count, too */
    uint32_t rejected_records; /* Records of orbit files refused at the start */
    uint32_t objects_without_state; /* Objects left out of a frame because their orbit had no state at its time */
    uint32_t lost_outbound; /* Packets not sent: the client had left or did not read, or the system refused to send */
    uint32_t exposures_missed; /* By the wall and the external clock: exposures without a frame, because the previous one was not rendered or sent in time, or without an attitude (section 5.5) */
    uint32_t runts; /* Packets and serial frames shorter than any packet can be */
    uint32_t oversize; /* Packets and serial frames longer than any packet can be */
    uint32_t resent_blocks; /* Packets of a frame retransmitted at the client's request */
    uint32_t reconnects; /* Number of times that a link was lost and reopened */
    uint32_t incomplete; /* Messages of several CAN frames that were not completed */
    uint32_t bus_errors; /* CAN error frames */
    uint32_t bus_off; /* Number of times that the CAN controller was off the bus */
    uint32_t deadlines_missed; /* Frames not sent completely by their deadline */
    uint32_t frames_coarsened; /* Frames rendered with larger tolerances to be in time */
    uint32_t frames_dropped; /* Frames not sent to a slow client because a newer frame was ready */
    uint32_t attitudes_stale; /* Frames whose attitude was older than the limit */
    uint32_t attitudes_future; /* Frames whose only attitude was in the future */
    uint32_t triggers; /* Triggers accepted */
    uint32_t triggers_missed; /* Accepted Triggers without a frame: no attitude, the client's clock was set, too late, or a Reset, another client or the end of the run came first */
} skyloop_status_t;

/* A command was carried out. */
typedef struct {
    uint16_t apid; /* APID of the packet that it answers */
    uint16_t sequence_count; /* Sequence count of that packet */
} skyloop_ack_t;

/* A packet was refused. */
typedef struct {
    uint16_t apid; /* APID of the refused packet, as its octets state it */
    uint16_t sequence_count; /* Sequence count of that packet, as its octets state it */
    uint8_t reason; /* Why */
    const uint8_t *detail; /* What and where, for people; UTF-8 */
    size_t detail_length; /* its octets */
} skyloop_nack_t;

/* Square windows cut out of a frame. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint32_t index; /* Number of the packet among those with pixels */
    uint16_t first; /* Number of its first window in the frame */
    uint8_t count; /* Number of its windows; every packet but the last is full */
    uint8_t size; /* Columns and rows of a window [px] */
    uint8_t packing; /* Bits that a pixel takes [bit] */
    const uint8_t *data; /* So many records of the same length */
    size_t data_length; /* its octets */
} skyloop_window_block_t;

/* Records of the brightest objects in a frame, brightest first. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint16_t part; /* Number of the part */
    uint16_t parts; /* As label_parts */
    const uint8_t *data; /* The records */
    size_t data_length; /* its octets */
} skyloop_object_part_t;

/* A run of pixels, losslessly compressed. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint32_t index; /* Number of the packet among those with pixels */
    uint32_t first_pixel; /* Place of its first pixel */
    uint16_t count; /* Number of its pixels [px] */
    const uint8_t *data; /* The code */
    size_t data_length; /* its octets */
} skyloop_compressed_block_t;

/* Closes a frame: what is known only when all of it has been rendered and sent. */
typedef struct {
    uint32_t frame; /* The frame that it belongs to */
    uint32_t pixels_crc32; /* CRC-32 of all pixels of the frame in order, each as u16, whatever is sent of them */
    uint32_t trigger; /* Number of the Trigger that requested the frame; 0: none */
    uint8_t attitude_source; /* What its attitude was made of */
    uint8_t overrun; /* What was done about its being late */
    uint8_t sync; /* What the emulator went by for the client's time */
    bool in_time; /* 1: it left before its deadline */
    skyloop_timing_t timing; /* Its times */
    double clock_offset_s; /* What the client's clock is ahead of the emulator's own, counted from when it was first heard; 0 where the emulator keeps its own time [s] */
} skyloop_frame_end_t;

/* UDP: asks the client to prove its address by sending this packet back as it came (section 5.1). */
typedef struct {
    uint64_t token; /* A secret of this address and time */
} skyloop_challenge_t;

/* Any packet towards the emulator; header.apid says which. */
typedef struct {
    skyloop_header_t header;
    union {
        skyloop_attitude_t attitude;
        skyloop_command_t command;
    } as;
} skyloop_uplink_t;

/* Any packet from the emulator; header.apid says which. */
typedef struct {
    skyloop_header_t header;
    union {
        skyloop_frame_header_t frame_header;
        skyloop_pixel_block_t pixel_block;
        skyloop_label_part_t label_part;
        skyloop_status_t status;
        skyloop_ack_t ack;
        skyloop_nack_t nack;
        skyloop_window_block_t window_block;
        skyloop_object_part_t object_part;
        skyloop_compressed_block_t compressed_block;
        skyloop_frame_end_t frame_end;
        skyloop_challenge_t challenge;
    } as;
} skyloop_downlink_t;

/* ---- rules between fields ---------------------------------------------------------------------------------------- */

static inline skyloop_error_t skyloop_rule(bool holds) { return holds ? SKYLOOP_OK : SKYLOOP_BAD_VALUE; }

/* | |q| - 1 | <= 0.001 */
static inline skyloop_error_t skyloop_check_attitude(const skyloop_attitude_t *in)
{
    double squared = 0.0;
    for (size_t n = 0U; n < 4U; n++) {
        squared += in->q_icrf_to_body[n] * in->q_icrf_to_body[n];
    }
    const double low = 1.0 - 1e-3;
    const double high = 1.0 + 1e-3;
    return ((squared >= low * low) && (squared <= high * high)) ? SKYLOOP_OK : SKYLOOP_QUATERNION_NOT_UNIT;
}

/* A probability, a time of at most 60 s, or on and off. */
static inline skyloop_error_t skyloop_check_fault(const skyloop_fault_t *in)
{
    const bool is_time = (in->kind == SKYLOOP_FAULT_KIND_DELAY) || (in->kind == SKYLOOP_FAULT_KIND_JITTER);
    const bool is_switch = (in->kind == SKYLOOP_FAULT_KIND_STUCK) || (in->kind == SKYLOOP_FAULT_KIND_DOWN) ||
                           (in->kind == SKYLOOP_FAULT_KIND_BUS_OFF);
    const bool fits = (in->value >= 0.0) && (in->value <= (is_time ? 60.0 : 1.0));
    /* Between the two there is nothing: no comparison for equality is needed. */
    const bool is_half = (in->value > 0.0) && (in->value < 1.0);
    return skyloop_rule(fits && !(is_switch && is_half));
}

/* Octets of one window: its place and its pixels. */
static inline size_t skyloop_window_length(uint8_t packing, uint8_t size)
{
    return 4U + skyloop_packed_length(packing, (size_t)size * size);
}

/* Windows of a full packet. */
static inline size_t skyloop_windows_per_packet(uint8_t packing, uint8_t size)
{
    return (SKYLOOP_MAX_PAYLOAD - 13U) / skyloop_window_length(packing, size);
}

static inline uint64_t skyloop_divided_up(uint64_t all, uint64_t each) { return (all + each - 1U) / each; }

static inline bool skyloop_has_its_blocks(const skyloop_frame_header_t *in)
{
    const uint64_t pixels = (uint64_t)in->width * in->height;
    bool holds = false;
    switch (in->pixel_level) {
    case SKYLOOP_PIXEL_LEVEL_NONE:
        holds = in->blocks == 0U;
        break;
    case SKYLOOP_PIXEL_LEVEL_WINDOWS:
        holds = in->blocks == skyloop_divided_up(in->windows, skyloop_windows_per_packet(in->packing, in->window_size));
        break;
    case SKYLOOP_PIXEL_LEVEL_FRAME:
        holds = in->blocks == skyloop_divided_up(pixels, skyloop_pixels_per_block(in->packing));
        break;
    default:
        holds = (in->blocks >= 1U) && (in->blocks <= skyloop_divided_up(pixels, 16U));
        break;
    }
    return holds;
}

static inline bool skyloop_has_its_parts(const skyloop_frame_header_t *in)
{
    bool holds = false;
    switch (in->label_level) {
    case SKYLOOP_LABEL_LEVEL_NONE:
        holds = (in->label_parts == 0U) && (in->label_bytes == 0U);
        break;
    case SKYLOOP_LABEL_LEVEL_OBJECTS:
        holds = ((in->label_bytes % SKYLOOP_OBJECT_RECORD_LENGTH) == 0U) &&
                ((in->label_bytes / SKYLOOP_OBJECT_RECORD_LENGTH) <= 0xFFFFU) &&
                (in->label_parts == skyloop_divided_up(in->label_bytes, 25U * SKYLOOP_OBJECT_RECORD_LENGTH));
        break;
    default:
        holds = in->label_parts == skyloop_divided_up(in->label_bytes, SKYLOOP_MAX_PAYLOAD - 8U);
        break;
    }
    return holds;
}

static inline skyloop_error_t skyloop_check_frame_header(const skyloop_frame_header_t *in)
{
    const uint16_t shorter = (in->width < in->height) ? in->width : in->height;
    bool windows = (in->window_size == 0U) && (in->windows == 0U);
    if (in->pixel_level == SKYLOOP_PIXEL_LEVEL_WINDOWS) {
        windows = (in->window_size >= 1U) && (in->window_size <= 25U) && (in->window_size <= shorter);
    }
    return skyloop_rule((in->bits <= in->packing) && windows && skyloop_has_its_blocks(in) && skyloop_has_its_parts(in) &&
                        (in->exposure_start <= in->exposure_end));
}

static inline skyloop_error_t skyloop_check_status(const skyloop_status_t *in)
{
    return skyloop_rule(in->bits <= in->packing);
}

static inline skyloop_error_t skyloop_check_pixel_block(const skyloop_pixel_block_t *in)
{
    const size_t full = skyloop_pixels_per_block(in->packing);
    if ((in->count > full) || ((uint64_t)in->first_pixel != (uint64_t)in->index * full)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->data_length != skyloop_packed_length(in->packing, in->count)) {
        return SKYLOOP_BAD_LENGTH;
    }
    return skyloop_rule(skyloop_is_padded(in->packing, in->count, in->data, in->data_length));
}

static inline skyloop_error_t skyloop_check_window_block(const skyloop_window_block_t *in)
{
    const size_t most = skyloop_windows_per_packet(in->packing, in->size);
    const size_t each = skyloop_window_length(in->packing, in->size);
    if ((in->count > most) || ((uint64_t)in->first != (uint64_t)in->index * most)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->data_length != in->count * each) {
        return SKYLOOP_BAD_LENGTH;
    }
    for (size_t n = 1U; n <= in->count; n++) {
        if (!skyloop_is_padded(in->packing, in->size, in->data, n * each)) {
            return SKYLOOP_BAD_VALUE;
        }
    }
    return SKYLOOP_OK;
}

/* Part `part` of `parts` has `length` octets: as many as fit, fewer in the last. */
static inline bool skyloop_is_cut_right(uint16_t part, uint16_t parts, size_t length, size_t full)
{
    const bool is_last = (uint32_t)part + 1U == parts;
    return (part < parts) && (length > 0U) && (length <= full) && (is_last || (length == full));
}

static inline skyloop_error_t skyloop_check_label_part(const skyloop_label_part_t *in)
{
    return skyloop_rule(skyloop_is_cut_right(in->part, in->parts, in->text_length, SKYLOOP_MAX_PAYLOAD - 8U));
}

static inline skyloop_error_t skyloop_check_object_part(const skyloop_object_part_t *in)
{
    const size_t full = 25U * SKYLOOP_OBJECT_RECORD_LENGTH;
    if ((!skyloop_is_cut_right(in->part, in->parts, in->data_length, full)) ||
        ((in->data_length % SKYLOOP_OBJECT_RECORD_LENGTH) != 0U)) {
        return SKYLOOP_BAD_VALUE;
    }
    for (size_t at = 0U; at < in->data_length; at += SKYLOOP_OBJECT_RECORD_LENGTH) {
        if ((in->data[at] > 1U) || (in->data[at + 1U] > 3U)) {
            return SKYLOOP_BAD_VALUE;
        }
    }
    return SKYLOOP_OK;
}

/* Whether packets with this APID go towards the emulator. */
static inline bool skyloop_is_telecommand(uint16_t apid)
{
    return (apid == SKYLOOP_APID_ATTITUDE) ||
           (apid == SKYLOOP_APID_COMMAND);
}

static inline bool skyloop_is_known(uint16_t apid)
{
    return (apid == SKYLOOP_APID_ATTITUDE) ||
           (apid == SKYLOOP_APID_COMMAND) ||
           (apid == SKYLOOP_APID_FRAME_HEADER) ||
           (apid == SKYLOOP_APID_PIXEL_BLOCK) ||
           (apid == SKYLOOP_APID_LABELS) ||
           (apid == SKYLOOP_APID_STATUS) ||
           (apid == SKYLOOP_APID_ACK) ||
           (apid == SKYLOOP_APID_NACK) ||
           (apid == SKYLOOP_APID_WINDOWS) ||
           (apid == SKYLOOP_APID_OBJECTS) ||
           (apid == SKYLOOP_APID_COMPRESSED) ||
           (apid == SKYLOOP_APID_FRAME_END) ||
           (apid == SKYLOOP_APID_CHALLENGE);
}

/* ---- packets ----------------------------------------------------------------------------------------------------- */

/* Checks everything around the payload, in the ICD's order, and hands over a reader that stands on it. */
static inline skyloop_error_t skyloop_open(const uint8_t *packet, size_t length, skyloop_header_t *header,
                                           skyloop_reader_t *reader)
{
    if ((length < SKYLOOP_HEADER_LENGTH + 2U) || (length > SKYLOOP_MAX_PACKET)) {
        return SKYLOOP_BAD_LENGTH;
    }
    const skyloop_reader_t whole = {packet, length, 0U, SKYLOOP_OK};
    *reader = whole;
    reader->length = length - 2U;
    const uint16_t identification = skyloop_read_u16(reader);
    const uint16_t sequence = skyloop_read_u16(reader);
    const size_t stated = (size_t)skyloop_read_u16(reader) + 7U;
    const uint16_t crc = (uint16_t)(((uint32_t)packet[length - 2U] << 8) | packet[length - 1U]);
    header->apid = (uint16_t)(identification & 0x7FFU);
    header->sequence_count = (uint16_t)(sequence & 0x3FFFU);
    header->time = skyloop_read_u64(reader);
    const uint8_t version = skyloop_read_u8(reader);
    skyloop_error_t error = SKYLOOP_OK;
    if (stated != length) {
        error = SKYLOOP_BAD_LENGTH;
    } else if (crc != skyloop_crc16(packet, length - 2U)) {
        error = SKYLOOP_BAD_CRC;
    } else if (((identification >> 13) != 0U) || (version != SKYLOOP_VERSION)) {
        error = SKYLOOP_BAD_VERSION;
    } else if (((identification & 0x800U) == 0U) || ((sequence >> 14) != 3U)) {
        error = SKYLOOP_BAD_HEADER;
    } else if (!skyloop_is_known(header->apid)) {
        error = SKYLOOP_UNKNOWN_APID;
    } else if (skyloop_is_telecommand(header->apid) != ((identification & 0x1000U) != 0U)) {
        error = SKYLOOP_WRONG_TYPE;
    } else {
        /* all is well */
    }
    return error;
}

/* Writes what stands before the payload; skyloop_close writes what stands after it. */
static inline void skyloop_begin(skyloop_writer_t *writer, const skyloop_header_t *header)
{
    const uint32_t direction = skyloop_is_telecommand(header->apid) ? 0x1000U : 0U;
    skyloop_write_u16(writer, (uint16_t)(direction | 0x800U | (header->apid & 0x7FFU)));
    skyloop_write_u16(writer, (uint16_t)(0xC000U | (header->sequence_count & 0x3FFFU)));
    skyloop_write_u16(writer, 0U); /* the length, known below */
    skyloop_write_u64(writer, header->time);
    skyloop_write_u8(writer, SKYLOOP_VERSION);
}

static inline skyloop_error_t skyloop_close(skyloop_writer_t *writer, size_t *length)
{
    skyloop_write_u16(writer, 0U); /* the CRC, known below */
    if (writer->error == SKYLOOP_OK) {
        const size_t field = writer->at - 7U;
        writer->octets[4] = (uint8_t)(field >> 8);
        writer->octets[5] = (uint8_t)field;
        const uint16_t crc = skyloop_crc16(writer->octets, writer->at - 2U);
        writer->octets[writer->at - 2U] = (uint8_t)(crc >> 8);
        writer->octets[writer->at - 1U] = (uint8_t)crc;
        *length = writer->at;
    }
    return writer->error;
}

/* ---- codecs ------------------------------------------------------------------------------------------------------ */

static inline skyloop_error_t skyloop_valid_output(const skyloop_output_t *in)
{
    if (in->window_size < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->window_size > 25U) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_output(skyloop_reader_t *reader, skyloop_output_t *out)
{
    out->pixels = skyloop_read_u8(reader);
    if (!skyloop_is_pixel_level(out->pixels)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->labels = skyloop_read_u8(reader);
    if (!skyloop_is_label_level(out->labels)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->window_size = skyloop_read_u8(reader);
    out->windows = skyloop_read_u8(reader);
    out->objects = skyloop_read_u16(reader);
}

static inline void skyloop_write_output(skyloop_writer_t *writer, const skyloop_output_t *in)
{
    skyloop_write_u8(writer, in->pixels);
    skyloop_write_u8(writer, in->labels);
    skyloop_write_u8(writer, in->window_size);
    skyloop_write_u8(writer, in->windows);
    skyloop_write_u16(writer, in->objects);
}

static inline skyloop_error_t skyloop_valid_positions(const skyloop_positions_t *in)
{
    if (in->count > 64U) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_positions(skyloop_reader_t *reader, skyloop_positions_t *out)
{
    out->count = skyloop_read_u8(reader);
    if (out->count > 64U) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    for (size_t n = 0U; (reader->error == SKYLOOP_OK) && (n < out->count); n++) {
        for (size_t k = 0U; k < 2U; k++) {
            out->at[n][k] = skyloop_read_u16(reader);
        }
    }
}

static inline void skyloop_write_positions(skyloop_writer_t *writer, const skyloop_positions_t *in)
{
    skyloop_write_u8(writer, in->count);
    if (in->count > 64U) {
        writer->error = SKYLOOP_TOO_LONG;
    }
    for (size_t n = 0U; (writer->error == SKYLOOP_OK) && (n < in->count); n++) {
        for (size_t k = 0U; k < 2U; k++) {
            skyloop_write_u16(writer, in->at[n][k]);
        }
    }
}

static inline skyloop_error_t skyloop_valid_fault(const skyloop_fault_t *in)
{
    if (!((in->seconds >= 0.0) && (in->seconds <= 1000000.0))) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_fault(in);
}

static inline void skyloop_read_fault(skyloop_reader_t *reader, skyloop_fault_t *out)
{
    out->kind = skyloop_read_u8(reader);
    if (!skyloop_is_fault_kind(out->kind)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->direction = skyloop_read_u8(reader);
    if (!skyloop_is_direction(out->direction)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->value = skyloop_read_f64(reader);
    out->seconds = skyloop_read_f64(reader);
}

static inline void skyloop_write_fault(skyloop_writer_t *writer, const skyloop_fault_t *in)
{
    skyloop_write_u8(writer, in->kind);
    skyloop_write_u8(writer, in->direction);
    skyloop_write_f64(writer, in->value);
    skyloop_write_f64(writer, in->seconds);
}

static inline skyloop_error_t skyloop_valid_object_record(const skyloop_object_record_t *in)
{
    (void)in;
    return SKYLOOP_OK;
}

static inline void skyloop_read_object_record(skyloop_reader_t *reader, skyloop_object_record_t *out)
{
    const uint8_t kind = skyloop_read_u8(reader);
    if (kind > 1U) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->is_rso = (kind & 1U) != 0U;
    const uint8_t flags = skyloop_read_u8(reader);
    if (flags > 3U) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->in_frame = (flags & 1U) != 0U;
    out->visible = (flags & 2U) != 0U;
    skyloop_read_octets(reader, out->id, 16U);
    out->x_px = skyloop_read_f64(reader);
    out->y_px = skyloop_read_f64(reader);
    out->dx_px = skyloop_read_f32(reader);
    out->dy_px = skyloop_read_f32(reader);
    out->mag = skyloop_read_f32(reader);
    out->snr = skyloop_read_f32(reader);
    out->electrons = skyloop_read_f32(reader);
}

static inline void skyloop_write_object_record(skyloop_writer_t *writer, const skyloop_object_record_t *in)
{
    skyloop_write_u8(writer, (uint8_t)((in->is_rso ? 1U : 0U)));
    skyloop_write_u8(writer, (uint8_t)((in->in_frame ? 1U : 0U) | (in->visible ? 2U : 0U)));
    skyloop_write_octets(writer, in->id, 16U);
    skyloop_write_f64(writer, in->x_px);
    skyloop_write_f64(writer, in->y_px);
    skyloop_write_f32(writer, in->dx_px);
    skyloop_write_f32(writer, in->dy_px);
    skyloop_write_f32(writer, in->mag);
    skyloop_write_f32(writer, in->snr);
    skyloop_write_f32(writer, in->electrons);
}

static inline skyloop_error_t skyloop_valid_timing(const skyloop_timing_t *in)
{
    if (!skyloop_is_finite(in->attitude_age_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->first_pixel_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->last_pixel_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->first_octet_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->last_octet_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->spare_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_timing(skyloop_reader_t *reader, skyloop_timing_t *out)
{
    out->attitude_age_s = skyloop_read_f32(reader);
    out->first_pixel_s = skyloop_read_f32(reader);
    out->last_pixel_s = skyloop_read_f32(reader);
    out->first_octet_s = skyloop_read_f32(reader);
    out->last_octet_s = skyloop_read_f32(reader);
    out->spare_s = skyloop_read_f32(reader);
}

static inline void skyloop_write_timing(skyloop_writer_t *writer, const skyloop_timing_t *in)
{
    skyloop_write_f32(writer, in->attitude_age_s);
    skyloop_write_f32(writer, in->first_pixel_s);
    skyloop_write_f32(writer, in->last_pixel_s);
    skyloop_write_f32(writer, in->first_octet_s);
    skyloop_write_f32(writer, in->last_octet_s);
    skyloop_write_f32(writer, in->spare_s);
}

static inline skyloop_error_t skyloop_valid_attitude(const skyloop_attitude_t *in)
{
    for (size_t n = 0U; n < 4U; n++) {
        if (!skyloop_is_finite(in->q_icrf_to_body[n])) {
            return SKYLOOP_NOT_FINITE;
        }
    }
    for (size_t n = 0U; n < 3U; n++) {
        if (!skyloop_is_finite(in->rates_rad_s[n])) {
            return SKYLOOP_NOT_FINITE;
        }
    }
    if (in->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            if (!skyloop_is_finite(in->position_m[n])) {
                return SKYLOOP_NOT_FINITE;
            }
        }
    }
    if (in->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            if (!skyloop_is_finite(in->velocity_m_s[n])) {
                return SKYLOOP_NOT_FINITE;
            }
        }
    }
    return skyloop_check_attitude(in);
}

static inline void skyloop_read_attitude(skyloop_reader_t *reader, skyloop_attitude_t *out)
{
    (void)memset(out, 0, sizeof *out);
    out->sequence = skyloop_read_u32(reader);
    const uint8_t flags = skyloop_read_u8(reader);
    if (flags > 1U) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->has_state = (flags == 1U);
    for (size_t n = 0U; n < 4U; n++) {
        out->q_icrf_to_body[n] = skyloop_read_f64(reader);
    }
    for (size_t n = 0U; n < 3U; n++) {
        out->rates_rad_s[n] = skyloop_read_f64(reader);
    }
    if (out->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            out->position_m[n] = skyloop_read_f64(reader);
        }
    }
    if (out->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            out->velocity_m_s[n] = skyloop_read_f64(reader);
        }
    }
}

static inline void skyloop_write_attitude(skyloop_writer_t *writer, const skyloop_attitude_t *in)
{
    skyloop_write_u32(writer, in->sequence);
    skyloop_write_u8(writer, in->has_state ? 1U : 0U);
    for (size_t n = 0U; n < 4U; n++) {
        skyloop_write_f64(writer, in->q_icrf_to_body[n]);
    }
    for (size_t n = 0U; n < 3U; n++) {
        skyloop_write_f64(writer, in->rates_rad_s[n]);
    }
    if (in->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            skyloop_write_f64(writer, in->position_m[n]);
        }
    }
    if (in->has_state) {
        for (size_t n = 0U; n < 3U; n++) {
            skyloop_write_f64(writer, in->velocity_m_s[n]);
        }
    }
}

static inline skyloop_error_t skyloop_valid_command(const skyloop_command_t *in)
{
    skyloop_error_t error = SKYLOOP_OK;
    switch (in->opcode) {
    case SKYLOOP_OPCODE_EXPOSURE:
        if (!skyloop_is_positive(in->as.exposure.seconds)) {
            return SKYLOOP_BAD_VALUE;
        }
        break;
    case SKYLOOP_OPCODE_GAIN:
        if (!skyloop_is_positive(in->as.gain.e_per_dn)) {
            return SKYLOOP_BAD_VALUE;
        }
        break;
    case SKYLOOP_OPCODE_FRAME_RATE:
        if (!skyloop_is_positive(in->as.frame_rate.hz)) {
            return SKYLOOP_BAD_VALUE;
        }
        break;
    case SKYLOOP_OPCODE_OUTPUT:
        error = skyloop_valid_output(&in->as.output);
        break;
    case SKYLOOP_OPCODE_POSITIONS:
        error = skyloop_valid_positions(&in->as.positions);
        break;
    case SKYLOOP_OPCODE_FAULT:
        error = skyloop_valid_fault(&in->as.fault);
        break;
    case SKYLOOP_OPCODE_TRIGGER:
        if (in->as.trigger.number < 1U) {
            return SKYLOOP_BAD_VALUE;
        }
        break;
    default:
        break;
    }
    return error;
}

static inline void skyloop_read_command(skyloop_reader_t *reader, skyloop_command_t *out)
{
    out->opcode = skyloop_read_u8(reader);
    switch (out->opcode) {
    case SKYLOOP_OPCODE_EXPOSURE:
        out->as.exposure.seconds = skyloop_read_f64(reader);
        break;
    case SKYLOOP_OPCODE_GAIN:
        out->as.gain.e_per_dn = skyloop_read_f64(reader);
        break;
    case SKYLOOP_OPCODE_FRAME_RATE:
        out->as.frame_rate.hz = skyloop_read_f64(reader);
        break;
    case SKYLOOP_OPCODE_SINGLE_SHOT:
        break;
    case SKYLOOP_OPCODE_RESET:
        break;
    case SKYLOOP_OPCODE_PING:
        break;
    case SKYLOOP_OPCODE_CREDIT:
        out->as.credit.packets = skyloop_read_u32(reader);
        break;
    case SKYLOOP_OPCODE_OUTPUT:
        skyloop_read_output(reader, &out->as.output);
        break;
    case SKYLOOP_OPCODE_POSITIONS:
        skyloop_read_positions(reader, &out->as.positions);
        break;
    case SKYLOOP_OPCODE_RESEND:
        out->as.resend.frame = skyloop_read_u32(reader);
        out->as.resend.first = skyloop_read_u32(reader);
        out->as.resend.count = skyloop_read_u32(reader);
        break;
    case SKYLOOP_OPCODE_FAULT:
        skyloop_read_fault(reader, &out->as.fault);
        break;
    case SKYLOOP_OPCODE_TRIGGER:
        out->as.trigger.number = skyloop_read_u32(reader);
        out->as.trigger.start = skyloop_read_u64(reader);
        break;
    case SKYLOOP_OPCODE_PAUSE:
        break;
    case SKYLOOP_OPCODE_RESUME:
        break;
    default:
        skyloop_fail(reader, SKYLOOP_UNKNOWN_OPCODE);
        break;
    }
}

static inline void skyloop_write_command(skyloop_writer_t *writer, const skyloop_command_t *in)
{
    skyloop_write_u8(writer, in->opcode);
    switch (in->opcode) {
    case SKYLOOP_OPCODE_EXPOSURE:
        skyloop_write_f64(writer, in->as.exposure.seconds);
        break;
    case SKYLOOP_OPCODE_GAIN:
        skyloop_write_f64(writer, in->as.gain.e_per_dn);
        break;
    case SKYLOOP_OPCODE_FRAME_RATE:
        skyloop_write_f64(writer, in->as.frame_rate.hz);
        break;
    case SKYLOOP_OPCODE_SINGLE_SHOT:
        break;
    case SKYLOOP_OPCODE_RESET:
        break;
    case SKYLOOP_OPCODE_PING:
        break;
    case SKYLOOP_OPCODE_CREDIT:
        skyloop_write_u32(writer, in->as.credit.packets);
        break;
    case SKYLOOP_OPCODE_OUTPUT:
        skyloop_write_output(writer, &in->as.output);
        break;
    case SKYLOOP_OPCODE_POSITIONS:
        skyloop_write_positions(writer, &in->as.positions);
        break;
    case SKYLOOP_OPCODE_RESEND:
        skyloop_write_u32(writer, in->as.resend.frame);
        skyloop_write_u32(writer, in->as.resend.first);
        skyloop_write_u32(writer, in->as.resend.count);
        break;
    case SKYLOOP_OPCODE_FAULT:
        skyloop_write_fault(writer, &in->as.fault);
        break;
    case SKYLOOP_OPCODE_TRIGGER:
        skyloop_write_u32(writer, in->as.trigger.number);
        skyloop_write_u64(writer, in->as.trigger.start);
        break;
    case SKYLOOP_OPCODE_PAUSE:
        break;
    case SKYLOOP_OPCODE_RESUME:
        break;
    default:
        writer->error = SKYLOOP_UNKNOWN_OPCODE;
        break;
    }
}

static inline skyloop_error_t skyloop_valid_frame_header(const skyloop_frame_header_t *in)
{
    if (in->width < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->height < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->bits < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->bits > 16U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_positive(in->gain_e_per_dn)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->offset_dn)) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_frame_header(in);
}

static inline void skyloop_read_frame_header(skyloop_reader_t *reader, skyloop_frame_header_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->attitude_sequence = skyloop_read_u32(reader);
    out->width = skyloop_read_u16(reader);
    out->height = skyloop_read_u16(reader);
    out->bits = skyloop_read_u8(reader);
    out->packing = skyloop_read_u8(reader);
    if (!skyloop_is_packing(out->packing)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->pixel_level = skyloop_read_u8(reader);
    if (!skyloop_is_pixel_level(out->pixel_level)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->label_level = skyloop_read_u8(reader);
    if (!skyloop_is_label_level(out->label_level)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->window_size = skyloop_read_u8(reader);
    out->windows = skyloop_read_u16(reader);
    out->blocks = skyloop_read_u32(reader);
    out->label_parts = skyloop_read_u16(reader);
    out->label_bytes = skyloop_read_u32(reader);
    out->exposure_start = skyloop_read_u64(reader);
    out->exposure_end = skyloop_read_u64(reader);
    out->seed = skyloop_read_u64(reader);
    out->gain_e_per_dn = skyloop_read_f64(reader);
    out->offset_dn = skyloop_read_f64(reader);
}

static inline void skyloop_write_frame_header(skyloop_writer_t *writer, const skyloop_frame_header_t *in)
{
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u32(writer, in->attitude_sequence);
    skyloop_write_u16(writer, in->width);
    skyloop_write_u16(writer, in->height);
    skyloop_write_u8(writer, in->bits);
    skyloop_write_u8(writer, in->packing);
    skyloop_write_u8(writer, in->pixel_level);
    skyloop_write_u8(writer, in->label_level);
    skyloop_write_u8(writer, in->window_size);
    skyloop_write_u16(writer, in->windows);
    skyloop_write_u32(writer, in->blocks);
    skyloop_write_u16(writer, in->label_parts);
    skyloop_write_u32(writer, in->label_bytes);
    skyloop_write_u64(writer, in->exposure_start);
    skyloop_write_u64(writer, in->exposure_end);
    skyloop_write_u64(writer, in->seed);
    skyloop_write_f64(writer, in->gain_e_per_dn);
    skyloop_write_f64(writer, in->offset_dn);
}

static inline skyloop_error_t skyloop_valid_pixel_block(const skyloop_pixel_block_t *in)
{
    if (in->count < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_pixel_block(in);
}

static inline void skyloop_read_pixel_block(skyloop_reader_t *reader, skyloop_pixel_block_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->index = skyloop_read_u32(reader);
    out->first_pixel = skyloop_read_u32(reader);
    out->count = skyloop_read_u16(reader);
    out->packing = skyloop_read_u8(reader);
    if (!skyloop_is_packing(out->packing)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->data = skyloop_read_rest(reader, &out->data_length);
}

static inline void skyloop_write_pixel_block(skyloop_writer_t *writer, const skyloop_pixel_block_t *in)
{
    if (skyloop_valid_pixel_block(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u32(writer, in->index);
    skyloop_write_u32(writer, in->first_pixel);
    skyloop_write_u16(writer, in->count);
    skyloop_write_u8(writer, in->packing);
    skyloop_write_octets(writer, in->data, in->data_length);
}

static inline skyloop_error_t skyloop_valid_label_part(const skyloop_label_part_t *in)
{
    if (in->parts < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->text_length < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->text_length > 1375U) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_label_part(in);
}

static inline void skyloop_read_label_part(skyloop_reader_t *reader, skyloop_label_part_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->part = skyloop_read_u16(reader);
    out->parts = skyloop_read_u16(reader);
    out->text = skyloop_read_rest(reader, &out->text_length);
}

static inline void skyloop_write_label_part(skyloop_writer_t *writer, const skyloop_label_part_t *in)
{
    if (skyloop_valid_label_part(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u16(writer, in->part);
    skyloop_write_u16(writer, in->parts);
    skyloop_write_octets(writer, in->text, in->text_length);
}

static inline skyloop_error_t skyloop_valid_status(const skyloop_status_t *in)
{
    if (in->width < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->height < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->bits < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->bits > 16U) {
        return SKYLOOP_BAD_VALUE;
    }
    const skyloop_error_t output = skyloop_valid_output(&in->output);
    if (output != SKYLOOP_OK) {
        return output;
    }
    if (!skyloop_is_positive(in->exposure_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_positive(in->gain_e_per_dn)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_positive(in->frame_rate_hz)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->clock_offset_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    const skyloop_error_t timing = skyloop_valid_timing(&in->timing);
    if (timing != SKYLOOP_OK) {
        return timing;
    }
    if (!skyloop_is_finite(in->latency_p50_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->latency_p99_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_finite(in->latency_max_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_status(in);
}

static inline void skyloop_read_status(skyloop_reader_t *reader, skyloop_status_t *out)
{
    out->mode = skyloop_read_u8(reader);
    if (!skyloop_is_mode(out->mode)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->width = skyloop_read_u16(reader);
    out->height = skyloop_read_u16(reader);
    out->bits = skyloop_read_u8(reader);
    out->packing = skyloop_read_u8(reader);
    if (!skyloop_is_packing(out->packing)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    skyloop_read_output(reader, &out->output);
    out->exposure_s = skyloop_read_f64(reader);
    out->gain_e_per_dn = skyloop_read_f64(reader);
    out->frame_rate_hz = skyloop_read_f64(reader);
    out->next_frame = skyloop_read_u32(reader);
    out->packets_sent = skyloop_read_u32(reader);
    out->sync = skyloop_read_u8(reader);
    if (!skyloop_is_sync_state(out->sync)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->clock_offset_s = skyloop_read_f64(reader);
    out->exposure_start = skyloop_read_u64(reader);
    out->exposure_end = skyloop_read_u64(reader);
    skyloop_read_timing(reader, &out->timing);
    out->latency_p50_s = skyloop_read_f32(reader);
    out->latency_p99_s = skyloop_read_f32(reader);
    out->latency_max_s = skyloop_read_f32(reader);
    out->withheld = skyloop_read_u8(reader);
    if (!skyloop_is_withheld(out->withheld)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->attitudes = skyloop_read_u32(reader);
    out->commands = skyloop_read_u32(reader);
    out->frames_rendered = skyloop_read_u32(reader);
    out->frames_delivered = skyloop_read_u32(reader);
    out->frames_abandoned = skyloop_read_u32(reader);
    out->bad_crc = skyloop_read_u32(reader);
    out->bad_version = skyloop_read_u32(reader);
    out->bad_length = skyloop_read_u32(reader);
    out->unknown_type = skyloop_read_u32(reader);
    out->bad_framing = skyloop_read_u32(reader);
    out->bad_attitude = skyloop_read_u32(reader);
    out->time_backwards = skyloop_read_u32(reader);
    out->foreign_packets = skyloop_read_u32(reader);
    out->overflows = skyloop_read_u32(reader);
    out->bad_value = skyloop_read_u32(reader);
    out->refused = skyloop_read_u32(reader);
    out->sequence_gaps = skyloop_read_u32(reader);
    out->rejected_records = skyloop_read_u32(reader);
    out->objects_without_state = skyloop_read_u32(reader);
    out->lost_outbound = skyloop_read_u32(reader);
    out->exposures_missed = skyloop_read_u32(reader);
    out->runts = skyloop_read_u32(reader);
    out->oversize = skyloop_read_u32(reader);
    out->resent_blocks = skyloop_read_u32(reader);
    out->reconnects = skyloop_read_u32(reader);
    out->incomplete = skyloop_read_u32(reader);
    out->bus_errors = skyloop_read_u32(reader);
    out->bus_off = skyloop_read_u32(reader);
    out->deadlines_missed = skyloop_read_u32(reader);
    out->frames_coarsened = skyloop_read_u32(reader);
    out->frames_dropped = skyloop_read_u32(reader);
    out->attitudes_stale = skyloop_read_u32(reader);
    out->attitudes_future = skyloop_read_u32(reader);
    out->triggers = skyloop_read_u32(reader);
    out->triggers_missed = skyloop_read_u32(reader);
}

static inline void skyloop_write_status(skyloop_writer_t *writer, const skyloop_status_t *in)
{
    skyloop_write_u8(writer, in->mode);
    skyloop_write_u16(writer, in->width);
    skyloop_write_u16(writer, in->height);
    skyloop_write_u8(writer, in->bits);
    skyloop_write_u8(writer, in->packing);
    skyloop_write_output(writer, &in->output);
    skyloop_write_f64(writer, in->exposure_s);
    skyloop_write_f64(writer, in->gain_e_per_dn);
    skyloop_write_f64(writer, in->frame_rate_hz);
    skyloop_write_u32(writer, in->next_frame);
    skyloop_write_u32(writer, in->packets_sent);
    skyloop_write_u8(writer, in->sync);
    skyloop_write_f64(writer, in->clock_offset_s);
    skyloop_write_u64(writer, in->exposure_start);
    skyloop_write_u64(writer, in->exposure_end);
    skyloop_write_timing(writer, &in->timing);
    skyloop_write_f32(writer, in->latency_p50_s);
    skyloop_write_f32(writer, in->latency_p99_s);
    skyloop_write_f32(writer, in->latency_max_s);
    skyloop_write_u8(writer, in->withheld);
    skyloop_write_u32(writer, in->attitudes);
    skyloop_write_u32(writer, in->commands);
    skyloop_write_u32(writer, in->frames_rendered);
    skyloop_write_u32(writer, in->frames_delivered);
    skyloop_write_u32(writer, in->frames_abandoned);
    skyloop_write_u32(writer, in->bad_crc);
    skyloop_write_u32(writer, in->bad_version);
    skyloop_write_u32(writer, in->bad_length);
    skyloop_write_u32(writer, in->unknown_type);
    skyloop_write_u32(writer, in->bad_framing);
    skyloop_write_u32(writer, in->bad_attitude);
    skyloop_write_u32(writer, in->time_backwards);
    skyloop_write_u32(writer, in->foreign_packets);
    skyloop_write_u32(writer, in->overflows);
    skyloop_write_u32(writer, in->bad_value);
    skyloop_write_u32(writer, in->refused);
    skyloop_write_u32(writer, in->sequence_gaps);
    skyloop_write_u32(writer, in->rejected_records);
    skyloop_write_u32(writer, in->objects_without_state);
    skyloop_write_u32(writer, in->lost_outbound);
    skyloop_write_u32(writer, in->exposures_missed);
    skyloop_write_u32(writer, in->runts);
    skyloop_write_u32(writer, in->oversize);
    skyloop_write_u32(writer, in->resent_blocks);
    skyloop_write_u32(writer, in->reconnects);
    skyloop_write_u32(writer, in->incomplete);
    skyloop_write_u32(writer, in->bus_errors);
    skyloop_write_u32(writer, in->bus_off);
    skyloop_write_u32(writer, in->deadlines_missed);
    skyloop_write_u32(writer, in->frames_coarsened);
    skyloop_write_u32(writer, in->frames_dropped);
    skyloop_write_u32(writer, in->attitudes_stale);
    skyloop_write_u32(writer, in->attitudes_future);
    skyloop_write_u32(writer, in->triggers);
    skyloop_write_u32(writer, in->triggers_missed);
}

static inline skyloop_error_t skyloop_valid_ack(const skyloop_ack_t *in)
{
    if (in->apid > 2047U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->sequence_count > 16383U) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_ack(skyloop_reader_t *reader, skyloop_ack_t *out)
{
    out->apid = skyloop_read_u16(reader);
    out->sequence_count = skyloop_read_u16(reader);
}

static inline void skyloop_write_ack(skyloop_writer_t *writer, const skyloop_ack_t *in)
{
    skyloop_write_u16(writer, in->apid);
    skyloop_write_u16(writer, in->sequence_count);
}

static inline skyloop_error_t skyloop_valid_nack(const skyloop_nack_t *in)
{
    if (in->apid > 2047U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->sequence_count > 16383U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->detail_length > 200U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (!skyloop_is_utf8(in->detail, in->detail_length)) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_nack(skyloop_reader_t *reader, skyloop_nack_t *out)
{
    out->apid = skyloop_read_u16(reader);
    out->sequence_count = skyloop_read_u16(reader);
    out->reason = skyloop_read_u8(reader);
    if (!skyloop_is_reason(out->reason)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->detail = skyloop_read_rest(reader, &out->detail_length);
}

static inline void skyloop_write_nack(skyloop_writer_t *writer, const skyloop_nack_t *in)
{
    if (skyloop_valid_nack(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u16(writer, in->apid);
    skyloop_write_u16(writer, in->sequence_count);
    skyloop_write_u8(writer, in->reason);
    skyloop_write_octets(writer, in->detail, in->detail_length);
}

static inline skyloop_error_t skyloop_valid_window_block(const skyloop_window_block_t *in)
{
    if (in->count < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->size < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->size > 25U) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_window_block(in);
}

static inline void skyloop_read_window_block(skyloop_reader_t *reader, skyloop_window_block_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->index = skyloop_read_u32(reader);
    out->first = skyloop_read_u16(reader);
    out->count = skyloop_read_u8(reader);
    out->size = skyloop_read_u8(reader);
    out->packing = skyloop_read_u8(reader);
    if (!skyloop_is_packing(out->packing)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->data = skyloop_read_rest(reader, &out->data_length);
}

static inline void skyloop_write_window_block(skyloop_writer_t *writer, const skyloop_window_block_t *in)
{
    if (skyloop_valid_window_block(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u32(writer, in->index);
    skyloop_write_u16(writer, in->first);
    skyloop_write_u8(writer, in->count);
    skyloop_write_u8(writer, in->size);
    skyloop_write_u8(writer, in->packing);
    skyloop_write_octets(writer, in->data, in->data_length);
}

static inline skyloop_error_t skyloop_valid_object_part(const skyloop_object_part_t *in)
{
    if (in->parts < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    return skyloop_check_object_part(in);
}

static inline void skyloop_read_object_part(skyloop_reader_t *reader, skyloop_object_part_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->part = skyloop_read_u16(reader);
    out->parts = skyloop_read_u16(reader);
    out->data = skyloop_read_rest(reader, &out->data_length);
}

static inline void skyloop_write_object_part(skyloop_writer_t *writer, const skyloop_object_part_t *in)
{
    if (skyloop_valid_object_part(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u16(writer, in->part);
    skyloop_write_u16(writer, in->parts);
    skyloop_write_octets(writer, in->data, in->data_length);
}

static inline skyloop_error_t skyloop_valid_compressed_block(const skyloop_compressed_block_t *in)
{
    if (in->count < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->data_length < 1U) {
        return SKYLOOP_BAD_VALUE;
    }
    if (in->data_length > 1369U) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_compressed_block(skyloop_reader_t *reader, skyloop_compressed_block_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->index = skyloop_read_u32(reader);
    out->first_pixel = skyloop_read_u32(reader);
    out->count = skyloop_read_u16(reader);
    out->data = skyloop_read_rest(reader, &out->data_length);
}

static inline void skyloop_write_compressed_block(skyloop_writer_t *writer, const skyloop_compressed_block_t *in)
{
    if (skyloop_valid_compressed_block(in) != SKYLOOP_OK) {
        writer->error = SKYLOOP_INCONSISTENT;
        return;
    }
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u32(writer, in->index);
    skyloop_write_u32(writer, in->first_pixel);
    skyloop_write_u16(writer, in->count);
    skyloop_write_octets(writer, in->data, in->data_length);
}

static inline skyloop_error_t skyloop_valid_frame_end(const skyloop_frame_end_t *in)
{
    const skyloop_error_t timing = skyloop_valid_timing(&in->timing);
    if (timing != SKYLOOP_OK) {
        return timing;
    }
    if (!skyloop_is_finite(in->clock_offset_s)) {
        return SKYLOOP_BAD_VALUE;
    }
    return SKYLOOP_OK;
}

static inline void skyloop_read_frame_end(skyloop_reader_t *reader, skyloop_frame_end_t *out)
{
    out->frame = skyloop_read_u32(reader);
    out->pixels_crc32 = skyloop_read_u32(reader);
    out->trigger = skyloop_read_u32(reader);
    out->attitude_source = skyloop_read_u8(reader);
    if (!skyloop_is_attitude_source(out->attitude_source)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->overrun = skyloop_read_u8(reader);
    if (!skyloop_is_overrun(out->overrun)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->sync = skyloop_read_u8(reader);
    if (!skyloop_is_sync_state(out->sync)) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    const uint8_t flags = skyloop_read_u8(reader);
    if (flags > 1U) {
        skyloop_fail(reader, SKYLOOP_BAD_VALUE);
    }
    out->in_time = (flags & 1U) != 0U;
    skyloop_read_timing(reader, &out->timing);
    out->clock_offset_s = skyloop_read_f64(reader);
}

static inline void skyloop_write_frame_end(skyloop_writer_t *writer, const skyloop_frame_end_t *in)
{
    skyloop_write_u32(writer, in->frame);
    skyloop_write_u32(writer, in->pixels_crc32);
    skyloop_write_u32(writer, in->trigger);
    skyloop_write_u8(writer, in->attitude_source);
    skyloop_write_u8(writer, in->overrun);
    skyloop_write_u8(writer, in->sync);
    skyloop_write_u8(writer, (uint8_t)((in->in_time ? 1U : 0U)));
    skyloop_write_timing(writer, &in->timing);
    skyloop_write_f64(writer, in->clock_offset_s);
}

static inline skyloop_error_t skyloop_valid_challenge(const skyloop_challenge_t *in)
{
    (void)in;
    return SKYLOOP_OK;
}

static inline void skyloop_read_challenge(skyloop_reader_t *reader, skyloop_challenge_t *out)
{
    out->token = skyloop_read_u64(reader);
}

static inline void skyloop_write_challenge(skyloop_writer_t *writer, const skyloop_challenge_t *in)
{
    skyloop_write_u64(writer, in->token);
}

/* Reads exactly one packet. */
static inline skyloop_error_t skyloop_decode_uplink(const uint8_t *packet, size_t length, skyloop_uplink_t *out)
{
    skyloop_reader_t reader;
    skyloop_error_t error = skyloop_open(packet, length, &out->header, &reader);
    if (error != SKYLOOP_OK) {
        return error;
    }
    switch (out->header.apid) {
    case SKYLOOP_APID_ATTITUDE:
        skyloop_read_attitude(&reader, &out->as.attitude);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_attitude(&out->as.attitude);
        }
        break;
    case SKYLOOP_APID_COMMAND:
        skyloop_read_command(&reader, &out->as.command);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_command(&out->as.command);
        }
        break;
    default:
        error = SKYLOOP_UNKNOWN_APID;
        break;
    }
    return error;
}

/* Lays out one packet; `*length` is its length. Values are judged where they are received. */
static inline skyloop_error_t skyloop_encode_uplink(const skyloop_uplink_t *in, uint8_t *packet, size_t capacity, size_t *length)
{
    skyloop_writer_t writer = {packet, capacity, 0U, SKYLOOP_OK};
    skyloop_begin(&writer, &in->header);
    switch (in->header.apid) {
    case SKYLOOP_APID_ATTITUDE:
        skyloop_write_attitude(&writer, &in->as.attitude);
        break;
    case SKYLOOP_APID_COMMAND:
        skyloop_write_command(&writer, &in->as.command);
        break;
    default:
        writer.error = SKYLOOP_UNKNOWN_APID;
        break;
    }
    return skyloop_close(&writer, length);
}

/* Reads exactly one packet. */
static inline skyloop_error_t skyloop_decode_downlink(const uint8_t *packet, size_t length, skyloop_downlink_t *out)
{
    skyloop_reader_t reader;
    skyloop_error_t error = skyloop_open(packet, length, &out->header, &reader);
    if (error != SKYLOOP_OK) {
        return error;
    }
    switch (out->header.apid) {
    case SKYLOOP_APID_FRAME_HEADER:
        skyloop_read_frame_header(&reader, &out->as.frame_header);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_frame_header(&out->as.frame_header);
        }
        break;
    case SKYLOOP_APID_PIXEL_BLOCK:
        skyloop_read_pixel_block(&reader, &out->as.pixel_block);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_pixel_block(&out->as.pixel_block);
        }
        break;
    case SKYLOOP_APID_LABELS:
        skyloop_read_label_part(&reader, &out->as.label_part);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_label_part(&out->as.label_part);
        }
        break;
    case SKYLOOP_APID_STATUS:
        skyloop_read_status(&reader, &out->as.status);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_status(&out->as.status);
        }
        break;
    case SKYLOOP_APID_ACK:
        skyloop_read_ack(&reader, &out->as.ack);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_ack(&out->as.ack);
        }
        break;
    case SKYLOOP_APID_NACK:
        skyloop_read_nack(&reader, &out->as.nack);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_nack(&out->as.nack);
        }
        break;
    case SKYLOOP_APID_WINDOWS:
        skyloop_read_window_block(&reader, &out->as.window_block);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_window_block(&out->as.window_block);
        }
        break;
    case SKYLOOP_APID_OBJECTS:
        skyloop_read_object_part(&reader, &out->as.object_part);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_object_part(&out->as.object_part);
        }
        break;
    case SKYLOOP_APID_COMPRESSED:
        skyloop_read_compressed_block(&reader, &out->as.compressed_block);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_compressed_block(&out->as.compressed_block);
        }
        break;
    case SKYLOOP_APID_FRAME_END:
        skyloop_read_frame_end(&reader, &out->as.frame_end);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_frame_end(&out->as.frame_end);
        }
        break;
    case SKYLOOP_APID_CHALLENGE:
        skyloop_read_challenge(&reader, &out->as.challenge);
        error = skyloop_read_end(&reader);
        if (error == SKYLOOP_OK) {
            error = skyloop_valid_challenge(&out->as.challenge);
        }
        break;
    default:
        error = SKYLOOP_UNKNOWN_APID;
        break;
    }
    return error;
}

/* Lays out one packet; `*length` is its length. Values are judged where they are received. */
static inline skyloop_error_t skyloop_encode_downlink(const skyloop_downlink_t *in, uint8_t *packet, size_t capacity, size_t *length)
{
    skyloop_writer_t writer = {packet, capacity, 0U, SKYLOOP_OK};
    skyloop_begin(&writer, &in->header);
    switch (in->header.apid) {
    case SKYLOOP_APID_FRAME_HEADER:
        skyloop_write_frame_header(&writer, &in->as.frame_header);
        break;
    case SKYLOOP_APID_PIXEL_BLOCK:
        skyloop_write_pixel_block(&writer, &in->as.pixel_block);
        break;
    case SKYLOOP_APID_LABELS:
        skyloop_write_label_part(&writer, &in->as.label_part);
        break;
    case SKYLOOP_APID_STATUS:
        skyloop_write_status(&writer, &in->as.status);
        break;
    case SKYLOOP_APID_ACK:
        skyloop_write_ack(&writer, &in->as.ack);
        break;
    case SKYLOOP_APID_NACK:
        skyloop_write_nack(&writer, &in->as.nack);
        break;
    case SKYLOOP_APID_WINDOWS:
        skyloop_write_window_block(&writer, &in->as.window_block);
        break;
    case SKYLOOP_APID_OBJECTS:
        skyloop_write_object_part(&writer, &in->as.object_part);
        break;
    case SKYLOOP_APID_COMPRESSED:
        skyloop_write_compressed_block(&writer, &in->as.compressed_block);
        break;
    case SKYLOOP_APID_FRAME_END:
        skyloop_write_frame_end(&writer, &in->as.frame_end);
        break;
    case SKYLOOP_APID_CHALLENGE:
        skyloop_write_challenge(&writer, &in->as.challenge);
        break;
    default:
        writer.error = SKYLOOP_UNKNOWN_APID;
        break;
    }
    return skyloop_close(&writer, length);
}

/* ---- the CAN form ------------------------------------------------------------------------------------------------ */

/* A frame with an 11-bit identifier; the same octets on a classic bus and on CAN FD. */
typedef struct {
    uint16_t id;
    uint8_t length;
    uint8_t data[8];
} skyloop_can_frame_t;

/* Bits are counted from the first, the most significant of the first octet. */
static inline void skyloop_bits_put(uint8_t data[8], unsigned at, unsigned bits, uint64_t value)
{
    for (unsigned n = 0U; n < bits; n++) {
        const unsigned place = at + n;
        if (((value >> (bits - 1U - n)) & 1U) != 0U) {
            data[place / 8U] |= (uint8_t)(0x80U >> (place % 8U));
        }
    }
}

static inline uint64_t skyloop_bits_get(const uint8_t data[8], unsigned at, unsigned bits)
{
    uint64_t value = 0U;
    for (unsigned place = at; place < at + bits; place++) {
        value = (value << 1) | (((uint32_t)data[place / 8U] >> (7U - (place % 8U))) & 1U);
    }
    return value;
}

/* Whether a number is 0 or has a normal f32 with its sign, exponent and first 23 bits of mantissa. */
static inline bool skyloop_can_carries(double number)
{
    const uint64_t exponent = (skyloop_f64_bits(number) >> 52) & 0x7FFU;
    return (number == 0.0) || ((exponent >= 897U) && (exponent <= 1150U));
}

static inline uint32_t skyloop_can_high(double number)
{
    const uint64_t bits = skyloop_f64_bits(number);
    const uint32_t sign = (uint32_t)(bits >> 63) << 31;
    const uint32_t exponent = (uint32_t)(((bits >> 52) & 0x7FFU) - 896U) << 23;
    return (number == 0.0) ? sign : (sign | exponent | ((uint32_t)(bits >> 29) & 0x7FFFFFU));
}

static inline uint32_t skyloop_can_low(double number) { return (uint32_t)(skyloop_f64_bits(number) & 0x1FFFFFFFU); }

static inline double skyloop_can_join(uint64_t high, uint64_t low)
{
    return skyloop_f64(skyloop_f64_bits((double)skyloop_f32((uint32_t)high)) | low);
}

#define SKYLOOP_CAN_ATTITUDE_BEGIN 0x100U /* Begins an attitude. */
#define SKYLOOP_CAN_ATTITUDE_TIME 0x101U /* Time at which the attitude holds. */
#define SKYLOOP_CAN_ATTITUDE_Q_X 0x102U /* q_icrf_to_body x. */
#define SKYLOOP_CAN_ATTITUDE_Q_Y 0x103U /* q_icrf_to_body y. */
#define SKYLOOP_CAN_ATTITUDE_Q_Z 0x104U /* q_icrf_to_body z. */
#define SKYLOOP_CAN_ATTITUDE_Q_W 0x105U /* q_icrf_to_body w. */
#define SKYLOOP_CAN_ATTITUDE_RATE_X 0x106U /* rates_rad_s x. */
#define SKYLOOP_CAN_ATTITUDE_RATE_Y 0x107U /* rates_rad_s y. */
#define SKYLOOP_CAN_ATTITUDE_RATE_Z 0x108U /* rates_rad_s z. */
#define SKYLOOP_CAN_ATTITUDE_POSITION_X 0x109U /* position_m x. */
#define SKYLOOP_CAN_ATTITUDE_POSITION_Y 0x10aU /* position_m y. */
#define SKYLOOP_CAN_ATTITUDE_POSITION_Z 0x10bU /* position_m z. */
#define SKYLOOP_CAN_ATTITUDE_VELOCITY_X 0x10cU /* velocity_m_s x. */
#define SKYLOOP_CAN_ATTITUDE_VELOCITY_Y 0x10dU /* velocity_m_s y. */
#define SKYLOOP_CAN_ATTITUDE_VELOCITY_Z 0x10eU /* velocity_m_s z. */
#define SKYLOOP_CAN_ATTITUDE_END 0x10fU /* Ends an attitude, which holds from here if all its frames came and the CRC fits. */
#define SKYLOOP_CAN_SHORT_COMMAND 0x110U /* A Command Ping, Reset, SingleShot, Credit, Pause or Resume whose time is 0. */
#define SKYLOOP_CAN_TRANSPORT_TO_EMULATOR 0x120U /* Any packet, in ISO-TP, and the flow control of those the other way. */
#define SKYLOOP_CAN_SHORT_ACK 0x210U /* An Ack whose time is 0. */
#define SKYLOOP_CAN_TRANSPORT_TO_CLIENT 0x220U /* Any packet, in ISO-TP, and the flow control of those the other way. */
#define SKYLOOP_CAN_ATTITUDE_FRAMES 16U

/* An attitude as frames, in the order in which they are sent; `counter` is the attitude's number, modulo 8. */
static inline skyloop_error_t skyloop_can_encode_attitude(const skyloop_header_t *header, const skyloop_attitude_t *in,
                                                          uint8_t counter, skyloop_can_frame_t frames[SKYLOOP_CAN_ATTITUDE_FRAMES],
                                                          size_t *count)
{
    uint8_t packet[SKYLOOP_MAX_PACKET];
    size_t length = 0U;
    bool carried = true;
    for (size_t n = 0U; n < 4U; n++) {
        carried = carried && (skyloop_can_carries(in->q_icrf_to_body[n]));
    }
    for (size_t n = 0U; n < 3U; n++) {
        carried = carried && (skyloop_can_carries(in->rates_rad_s[n]));
    }
    for (size_t n = 0U; n < 3U; n++) {
        carried = carried && ((!in->has_state) || skyloop_can_carries(in->position_m[n]));
    }
    for (size_t n = 0U; n < 3U; n++) {
        carried = carried && ((!in->has_state) || skyloop_can_carries(in->velocity_m_s[n]));
    }
    if (!carried) {
        return SKYLOOP_NOT_REPRESENTABLE;
    }
    skyloop_uplink_t whole;
    (void)memset(&whole, 0, sizeof whole);
    whole.header = *header;
    whole.header.apid = SKYLOOP_APID_ATTITUDE;
    whole.as.attitude = *in;
    const skyloop_error_t error = skyloop_encode_uplink(&whole, packet, sizeof packet, &length);
    if (error != SKYLOOP_OK) {
        return error;
    }
    const uint16_t crc = (uint16_t)(((uint32_t)packet[length - 2U] << 8) | packet[length - 1U]);
    size_t used = 0U;
    skyloop_can_frame_t *frame;
    frame = &frames[used];
    frame->id = 0x100U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 3U, counter);
    skyloop_bits_put(frame->data, 3U, 1U, in->has_state ? 1U : 0U);
    skyloop_bits_put(frame->data, 16U, 32U, in->sequence);
    skyloop_bits_put(frame->data, 48U, 3U, header->time);
    used++;
    frame = &frames[used];
    frame->id = 0x101U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, header->time >> 32);
    skyloop_bits_put(frame->data, 32U, 29U, header->time >> 3);
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x102U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->q_icrf_to_body[0]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->q_icrf_to_body[0]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x103U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->q_icrf_to_body[1]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->q_icrf_to_body[1]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x104U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->q_icrf_to_body[2]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->q_icrf_to_body[2]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x105U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->q_icrf_to_body[3]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->q_icrf_to_body[3]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x106U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->rates_rad_s[0]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->rates_rad_s[0]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x107U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->rates_rad_s[1]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->rates_rad_s[1]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    frame = &frames[used];
    frame->id = 0x108U;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->rates_rad_s[2]));
    skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->rates_rad_s[2]));
    skyloop_bits_put(frame->data, 61U, 3U, counter);
    used++;
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x109U;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->position_m[0]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->position_m[0]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x10aU;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->position_m[1]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->position_m[1]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x10bU;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->position_m[2]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->position_m[2]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x10cU;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->velocity_m_s[0]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->velocity_m_s[0]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x10dU;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->velocity_m_s[1]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->velocity_m_s[1]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    if (in->has_state) {
        frame = &frames[used];
        frame->id = 0x10eU;
        frame->length = 8U;
        (void)memset(frame->data, 0, sizeof frame->data);
        skyloop_bits_put(frame->data, 0U, 32U, skyloop_can_high(in->velocity_m_s[2]));
        skyloop_bits_put(frame->data, 32U, 29U, skyloop_can_low(in->velocity_m_s[2]));
        skyloop_bits_put(frame->data, 61U, 3U, counter);
        used++;
    }
    frame = &frames[used];
    frame->id = 0x10fU;
    frame->length = 8U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 3U, counter);
    skyloop_bits_put(frame->data, 16U, 14U, header->sequence_count);
    skyloop_bits_put(frame->data, 32U, 16U, crc);
    used++;
    *count = used;
    return SKYLOOP_OK;
}

/* An attitude under way. Begin with all zeros. */
typedef struct {
    uint8_t data[SKYLOOP_CAN_ATTITUDE_FRAMES][8];
    uint32_t seen; /* bit n: frame n has come */
    uint8_t counter;
} skyloop_can_attitude_t;

/* All frames are there: the attitude, if it is the one whose CRC came with it. */
static inline skyloop_error_t skyloop_can_finish(const skyloop_can_attitude_t *in, skyloop_uplink_t *out)
{
    uint8_t packet[SKYLOOP_MAX_PACKET];
    size_t length = 0U;
    (void)memset(out, 0, sizeof *out);
    skyloop_header_t *const header = &out->header;
    skyloop_attitude_t *const attitude = &out->as.attitude;
    header->apid = SKYLOOP_APID_ATTITUDE;
    attitude->has_state = skyloop_bits_get(in->data[0], 3U, 1U) != 0U;
    attitude->sequence = (uint32_t)skyloop_bits_get(in->data[0], 16U, 32U);
    header->time |= skyloop_bits_get(in->data[0], 48U, 3U);
    header->time |= skyloop_bits_get(in->data[1], 0U, 32U) << 32;
    header->time |= skyloop_bits_get(in->data[1], 32U, 29U) << 3;
    attitude->q_icrf_to_body[0] =
        skyloop_can_join(skyloop_bits_get(in->data[2], 0U, 32U), skyloop_bits_get(in->data[2], 32U, 29U));
    attitude->q_icrf_to_body[1] =
        skyloop_can_join(skyloop_bits_get(in->data[3], 0U, 32U), skyloop_bits_get(in->data[3], 32U, 29U));
    attitude->q_icrf_to_body[2] =
        skyloop_can_join(skyloop_bits_get(in->data[4], 0U, 32U), skyloop_bits_get(in->data[4], 32U, 29U));
    attitude->q_icrf_to_body[3] =
        skyloop_can_join(skyloop_bits_get(in->data[5], 0U, 32U), skyloop_bits_get(in->data[5], 32U, 29U));
    attitude->rates_rad_s[0] =
        skyloop_can_join(skyloop_bits_get(in->data[6], 0U, 32U), skyloop_bits_get(in->data[6], 32U, 29U));
    attitude->rates_rad_s[1] =
        skyloop_can_join(skyloop_bits_get(in->data[7], 0U, 32U), skyloop_bits_get(in->data[7], 32U, 29U));
    attitude->rates_rad_s[2] =
        skyloop_can_join(skyloop_bits_get(in->data[8], 0U, 32U), skyloop_bits_get(in->data[8], 32U, 29U));
    if (attitude->has_state) {
        attitude->position_m[0] =
            skyloop_can_join(skyloop_bits_get(in->data[9], 0U, 32U), skyloop_bits_get(in->data[9], 32U, 29U));
    }
    if (attitude->has_state) {
        attitude->position_m[1] =
            skyloop_can_join(skyloop_bits_get(in->data[10], 0U, 32U), skyloop_bits_get(in->data[10], 32U, 29U));
    }
    if (attitude->has_state) {
        attitude->position_m[2] =
            skyloop_can_join(skyloop_bits_get(in->data[11], 0U, 32U), skyloop_bits_get(in->data[11], 32U, 29U));
    }
    if (attitude->has_state) {
        attitude->velocity_m_s[0] =
            skyloop_can_join(skyloop_bits_get(in->data[12], 0U, 32U), skyloop_bits_get(in->data[12], 32U, 29U));
    }
    if (attitude->has_state) {
        attitude->velocity_m_s[1] =
            skyloop_can_join(skyloop_bits_get(in->data[13], 0U, 32U), skyloop_bits_get(in->data[13], 32U, 29U));
    }
    if (attitude->has_state) {
        attitude->velocity_m_s[2] =
            skyloop_can_join(skyloop_bits_get(in->data[14], 0U, 32U), skyloop_bits_get(in->data[14], 32U, 29U));
    }
    header->sequence_count = (uint16_t)skyloop_bits_get(in->data[15], 16U, 14U);
    const uint16_t crc = (uint16_t)skyloop_bits_get(in->data[15], 32U, 16U);
    const skyloop_error_t error = skyloop_encode_uplink(out, packet, sizeof packet, &length);
    if ((error != SKYLOOP_OK) || (crc != skyloop_crc16(packet, length - 2U))) {
        return SKYLOOP_INCOMPLETE;
    }
    return skyloop_valid_attitude(attitude);
}

/* Takes any frame. `*complete`: with this one an attitude ended, which is in `*out` if there is no error. */
static inline skyloop_error_t skyloop_can_decode_attitude(skyloop_can_attitude_t *in, const skyloop_can_frame_t *frame,
                                                          skyloop_uplink_t *out, bool *complete)
{
    static const uint8_t counters[SKYLOOP_CAN_ATTITUDE_FRAMES] = {0U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 61U, 0U}; /* first bit of the counter */
    *complete = false;
    if ((frame->id < 0x100U) || (frame->id >= 0x100U + SKYLOOP_CAN_ATTITUDE_FRAMES) || (frame->length != 8U)) {
        return SKYLOOP_OK;
    }
    const size_t at = (size_t)frame->id - 0x100U;
    const uint8_t counter = (uint8_t)skyloop_bits_get(frame->data, counters[at], 3U);
    const bool broken = (at == 0U) && (in->seen != 0U);
    if (at == 0U) {
        in->seen = 0U;
        in->counter = counter;
    }
    if (((in->seen == 0U) && (at != 0U)) || (counter != in->counter)) {
        const bool lost = (at == 15U) || (in->seen != 0U);
        in->seen = 0U;
        return lost ? SKYLOOP_INCOMPLETE : SKYLOOP_OK;
    }
    in->seen |= (uint32_t)1U << at;
    (void)memcpy(in->data[at], frame->data, sizeof frame->data);
    if (at != 15U) {
        return broken ? SKYLOOP_INCOMPLETE : SKYLOOP_OK;
    }
    const bool has_state = skyloop_bits_get(in->data[0], 3U, 1U) != 0U;
    const uint32_t wanted = has_state ? 0xffffU : 0x81ffU;
    const bool is_whole = (in->seen & wanted) == wanted;
    in->seen = 0U;
    *complete = is_whole;
    return is_whole ? skyloop_can_finish(in, out) : SKYLOOP_INCOMPLETE;
}

static inline bool skyloop_can_is_short(uint8_t opcode)
{
    return (opcode >= SKYLOOP_OPCODE_SINGLE_SHOT) && (opcode <= SKYLOOP_OPCODE_CREDIT);
}

/* A Command Ping, Reset, SingleShot, Credit, Pause or Resume whose time is 0. */
static inline skyloop_error_t skyloop_can_encode_command(const skyloop_uplink_t *in, skyloop_can_frame_t *frame)
{
    const uint8_t opcode = in->as.command.opcode;
    const bool is_short = skyloop_can_is_short(opcode);
    if ((in->header.apid != SKYLOOP_APID_COMMAND) || !is_short) {
        return SKYLOOP_NOT_REPRESENTABLE;
    }
    frame->id = SKYLOOP_CAN_SHORT_COMMAND;
    frame->length = 7U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 8U, in->as.command.opcode);
    skyloop_bits_put(frame->data, 8U, 16U, in->header.sequence_count);
    skyloop_bits_put(frame->data, 24U, 32U, (in->as.command.opcode == SKYLOOP_OPCODE_CREDIT) ? in->as.command.as.credit.packets : 0U);
    return SKYLOOP_OK;
}

static inline skyloop_error_t skyloop_can_decode_command(const skyloop_can_frame_t *frame, skyloop_uplink_t *out)
{
    if ((frame->id != SKYLOOP_CAN_SHORT_COMMAND) || (frame->length != 7U)) {
        return SKYLOOP_BAD_LENGTH;
    }
    (void)memset(out, 0, sizeof *out);
    out->header.apid = SKYLOOP_APID_COMMAND;
    out->as.command.opcode = (uint8_t)skyloop_bits_get(frame->data, 0U, 8U);
    out->header.sequence_count = (uint16_t)(skyloop_bits_get(frame->data, 8U, 16U) & 0x3FFFU);
    if (out->as.command.opcode == SKYLOOP_OPCODE_CREDIT) {
        out->as.command.as.credit.packets = (uint32_t)skyloop_bits_get(frame->data, 24U, 32U);
    }
    if (!skyloop_can_is_short(out->as.command.opcode)) {
        return SKYLOOP_UNKNOWN_OPCODE;
    }
    return SKYLOOP_OK;
}

/* An Ack whose time is 0. */
static inline skyloop_error_t skyloop_can_encode_ack(const skyloop_downlink_t *in, skyloop_can_frame_t *frame)
{
    const bool is_short = true;
    if ((in->header.apid != SKYLOOP_APID_ACK) || !is_short) {
        return SKYLOOP_NOT_REPRESENTABLE;
    }
    frame->id = SKYLOOP_CAN_SHORT_ACK;
    frame->length = 4U;
    (void)memset(frame->data, 0, sizeof frame->data);
    skyloop_bits_put(frame->data, 0U, 16U, in->as.ack.apid);
    skyloop_bits_put(frame->data, 16U, 16U, in->as.ack.sequence_count);
    return SKYLOOP_OK;
}

static inline skyloop_error_t skyloop_can_decode_ack(const skyloop_can_frame_t *frame, skyloop_downlink_t *out)
{
    if ((frame->id != SKYLOOP_CAN_SHORT_ACK) || (frame->length != 4U)) {
        return SKYLOOP_BAD_LENGTH;
    }
    (void)memset(out, 0, sizeof *out);
    out->header.apid = SKYLOOP_APID_ACK;
    out->as.ack.apid = (uint16_t)skyloop_bits_get(frame->data, 0U, 16U);
    out->as.ack.sequence_count = (uint16_t)skyloop_bits_get(frame->data, 16U, 16U);
    return SKYLOOP_OK;
}

#endif
