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
