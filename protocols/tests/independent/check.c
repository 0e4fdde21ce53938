/* include/skyloop.h against the golden vectors: every good packet encoded and decoded, every bad one refused for its
 * reason, frames of serial lines and CAN both ways; and what no vector has: every packet cut short everywhere. Decoders
 * are given allocated copies of the exact length, so that AddressSanitizer sees a read beyond the end. */
#include "../../include/skyloop.h"

#include <stdio.h>
#include <stdlib.h>

static unsigned long checks;
static const char *vector = "";

static void check(bool holds, const char *text, int line)
{
    checks++;
    if (!holds) {
        (void)fprintf(stderr, "check.c [%s]: line %d: %s does not hold\n", vector, line, text);
        exit(EXIT_FAILURE);
    }
}

#define CHECK(condition) check((condition), #condition, __LINE__)
#define SAME(a, b) CHECK((a) == (b))

/* A copy of exactly this length. */
static uint8_t *copied(const uint8_t *octets, size_t length)
{
    uint8_t *copy = malloc((length > 0U) ? length : 1U);
    if (copy == NULL) {
        (void)fputs("check.c: out of memory\n", stderr);
        exit(EXIT_FAILURE);
    }
    if (length > 0U) {
        (void)memcpy(copy, octets, length);
    }
    return copy;
}

/* The copy that a decoded message points into. */
static uint8_t *held;

#define RELEASE() free(held)

/* The message gives the octets, in no buffer that is too small; the octets give the message, and none of their
 * beginnings does. Each of them is damaged in every place as well: any answer will do, without a wrong access. */
#define TAKEN(link, name, octets, made, got)                                                                           \
    do {                                                                                                               \
        uint8_t buffer[SKYLOOP_MAX_PACKET];                                                                            \
        size_t length = 0U;                                                                                            \
        vector = (name);                                                                                               \
        SAME(skyloop_encode_##link(&(made), buffer, sizeof buffer, &length), SKYLOOP_OK);                              \
        SAME(length, sizeof(octets));                                                                                  \
        CHECK(memcmp(buffer, (octets), length) == 0);                                                                  \
        for (size_t cut = 0U; cut < sizeof(octets); cut++) {                                                           \
            uint8_t *small = copied((octets), cut);                                                                    \
            SAME(skyloop_encode_##link(&(made), small, cut, &length), SKYLOOP_BUFFER_TOO_SMALL);                       \
            free(small);                                                                                               \
            small = copied((octets), cut);                                                                             \
            SAME(skyloop_decode_##link(small, cut, &(got)), SKYLOOP_BAD_LENGTH);                                       \
            free(small);                                                                                               \
        }                                                                                                              \
        for (size_t at = 0U; at < sizeof(octets) - 2U; at++) {                                                         \
            uint8_t *damaged = copied((octets), sizeof(octets));                                                       \
            damaged[at] ^= (uint8_t)(1U + ((at * 37U) % 255U));                                                        \
            SAME(skyloop_decode_##link(damaged, sizeof(octets), &(got)),                                               \
                 ((at == 4U) || (at == 5U)) ? SKYLOOP_BAD_LENGTH : SKYLOOP_BAD_CRC);                                   \
            const uint16_t crc = skyloop_crc16(damaged, sizeof(octets) - 2U);                                          \
            damaged[sizeof(octets) - 2U] = (uint8_t)(crc >> 8);                                                        \
            damaged[sizeof(octets) - 1U] = (uint8_t)crc;                                                               \
            (void)skyloop_decode_##link(damaged, sizeof(octets), &(got));                                              \
            free(damaged);                                                                                             \
        }                                                                                                              \
        held = copied((octets), sizeof(octets));                                                                       \
        SAME(skyloop_decode_##link(held, sizeof(octets), &(got)), SKYLOOP_OK);                                         \
        SAME((got).header.apid, (made).header.apid);                                                                   \
        SAME((got).header.sequence_count, (made).header.sequence_count);                                               \
        SAME((got).header.time, (made).header.time);                                                                   \
    } while (false)

#define REFUSED(link, name, octets, length, reason)                                                                    \
    do {                                                                                                               \
        skyloop_##link##_t got;                                                                                        \
        uint8_t *copy = copied((octets), (length));                                                                    \
        vector = (name);                                                                                               \
        SAME(skyloop_decode_##link(copy, (length), &got), (reason));                                                   \
        free(copy);                                                                                                    \
    } while (false)

static void check_serial(const char *name, const uint8_t *packet, size_t length, const uint8_t *line, size_t line_length)
{
    uint8_t buffer[SKYLOOP_SLIP_MAX(SKYLOOP_MAX_PACKET)];
    size_t written = 0U;
    vector = name;
    SAME(skyloop_slip_encode(packet, length, buffer, sizeof buffer, &written), SKYLOOP_OK);
    SAME(written, line_length);
    CHECK(memcmp(buffer, line, line_length) == 0);
    for (size_t capacity = 0U; capacity < line_length; capacity++) {
        SAME(skyloop_slip_encode(packet, length, buffer, capacity, &written), SKYLOOP_BUFFER_TOO_SMALL);
    }
    skyloop_slip_t slip;
    skyloop_slip_begin(&slip);
    size_t found = 0U;
    unsigned packets = 0U;
    /* twice, with garbage between: a bad escape, an escaped END, a damaged frame, more octets than any packet has */
    for (unsigned turn = 0U; turn < 2U; turn++) {
        for (size_t n = 0U; n < line_length; n++) {
            if (skyloop_slip_push(&slip, line[n], &found)) {
                packets++;
                SAME(found, length);
                CHECK(memcmp(slip.octets, packet, length) == 0);
            }
        }
        const uint8_t garbage[] = {0xDB, 0x01, 0xC0, 0x02, 0xDB, 0xC0, 0x01, 0x02, 0x03, 0x04, 0x05, 0xC0, 0x01, 0xC0};
        for (size_t n = 0U; n < sizeof garbage; n++) {
            CHECK(!skyloop_slip_push(&slip, garbage[n], &found));
        }
        for (unsigned n = 0U; n < 3000U; n++) {
            CHECK(!skyloop_slip_push(&slip, 0x55U, &found));
        }
        CHECK(!skyloop_slip_push(&slip, 0xC0U, &found));
    }
    SAME(packets, 2U);
    SAME(slip.errors, 10U);
}

static bool same_frame(const skyloop_can_frame_t *a, const skyloop_can_frame_t *b)
{
    return (a->id == b->id) && (a->length == b->length) && (memcmp(a->data, b->data, a->length) == 0);
}

static void check_can_attitude(const char *name, const uint8_t *packet, size_t length, const skyloop_can_frame_t *frames,
                               size_t count)
{
    skyloop_uplink_t whole;
    skyloop_uplink_t got;
    skyloop_can_frame_t made[SKYLOOP_CAN_ATTITUDE_FRAMES];
    size_t used = 0U;
    vector = name;
    SAME(skyloop_decode_uplink(packet, length, &whole), SKYLOOP_OK);
    const uint8_t counter = (uint8_t)(frames[0].data[0] >> 5);
    SAME(skyloop_can_encode_attitude(&whole.header, &whole.as.attitude, counter, made, &used), SKYLOOP_OK);
    SAME(used, count);
    for (size_t n = 0U; n < count; n++) {
        CHECK(same_frame(&made[n], &frames[n]));
    }
    skyloop_can_attitude_t state;
    (void)memset(&state, 0, sizeof state);
    bool complete = false;
    /* whole; then without each of its frames in turn; then with each of its bits flipped; then whole again */
    for (size_t missing = 0U; missing <= count + (64U * count) + 1U; missing++) {
        const bool damaged = (missing > count) && (missing <= count + (64U * count));
        const bool is_whole = (missing == count) || (missing == count + (64U * count) + 1U);
        bool arrived = false;
        for (size_t n = 0U; n < count; n++) {
            skyloop_can_frame_t frame = frames[n];
            if (n == missing) {
                continue;
            }
            const size_t bit = missing - count - 1U;
            if (damaged && (bit / 64U == n)) {
                frame.data[(bit % 64U) / 8U] ^= (uint8_t)(0x80U >> (bit % 8U));
            }
            const skyloop_error_t error = skyloop_can_decode_attitude(&state, &frame, &got, &complete);
            arrived = arrived || (complete && (error == SKYLOOP_OK));
        }
        if (arrived && damaged) {
            /* only a spare bit may be wrong */
            uint8_t buffer[SKYLOOP_MAX_PACKET];
            size_t again = 0U;
            SAME(skyloop_encode_uplink(&got, buffer, sizeof buffer, &again), SKYLOOP_OK);
            SAME(again, length);
            CHECK(memcmp(buffer, packet, length) == 0);
        } else {
            SAME(arrived, is_whole);
        }
        if (!is_whole) {
            continue;
        }
        uint8_t buffer[SKYLOOP_MAX_PACKET];
        SAME(skyloop_encode_uplink(&got, buffer, sizeof buffer, &used), SKYLOOP_OK);
        SAME(used, length);
        CHECK(memcmp(buffer, packet, length) == 0);
    }
    whole.as.attitude.rates_rad_s[1] = 1e-39;
    SAME(skyloop_can_encode_attitude(&whole.header, &whole.as.attitude, 0U, made, &used), SKYLOOP_NOT_REPRESENTABLE);
}

static void check_can_command(const char *name, const uint8_t *packet, size_t length, const skyloop_can_frame_t *frames,
                              size_t count)
{
    skyloop_uplink_t whole;
    skyloop_can_frame_t made;
    uint8_t buffer[SKYLOOP_MAX_PACKET];
    size_t used = 0U;
    vector = name;
    SAME(count, 1U);
    SAME(skyloop_decode_uplink(packet, length, &whole), SKYLOOP_OK);
    SAME(skyloop_can_encode_command(&whole, &made), SKYLOOP_OK);
    CHECK(same_frame(&made, frames));
    SAME(skyloop_can_decode_command(frames, &whole), SKYLOOP_OK);
    SAME(skyloop_encode_uplink(&whole, buffer, sizeof buffer, &used), SKYLOOP_OK);
    SAME(used, length);
    CHECK(memcmp(buffer, packet, length) == 0);
}

static void check_can_ack(const char *name, const uint8_t *packet, size_t length, const skyloop_can_frame_t *frames,
                          size_t count)
{
    skyloop_downlink_t whole;
    skyloop_downlink_t got;
    skyloop_can_frame_t made;
    vector = name;
    SAME(count, 1U);
    SAME(skyloop_decode_downlink(packet, length, &whole), SKYLOOP_OK);
    SAME(skyloop_can_encode_ack(&whole, &made), SKYLOOP_OK);
    CHECK(same_frame(&made, frames));
    SAME(skyloop_can_decode_ack(frames, &got), SKYLOOP_OK);
    SAME(got.as.ack.apid, whole.as.ack.apid);
    SAME(got.as.ack.sequence_count, whole.as.ack.sequence_count);
}

/* Pixels go into their octets and come back. */
static void check_pixels(void)
{
    const uint16_t pixels[] = {0x000U, 0x123U, 0xABCU, 0xFFFU, 0x5A5U};
    const uint8_t packings[] = {12U, 16U};
    vector = "pixels";
    for (size_t p = 0U; p < 2U; p++) {
        for (size_t count = 0U; count <= 5U; count++) {
            const size_t length = skyloop_packed_length(packings[p], count);
            uint8_t *data = copied((const uint8_t *)"0123456789", length);
            SAME(skyloop_pack(packings[p], pixels, count, data, length), SKYLOOP_OK);
            for (size_t n = 0U; n < count; n++) {
                SAME(skyloop_pixel(packings[p], data, length, n), pixels[n]);
            }
            if (length > 0U) {
                SAME(skyloop_pack(packings[p], pixels, count, data, length - 1U), SKYLOOP_BUFFER_TOO_SMALL);
            }
            free(data);
        }
    }
}

/* The code gives the pixels; cut short or damaged anywhere it gives some answer, without a wrong access. */
static void check_compressed(const uint8_t *data, size_t length, uint8_t bits, const uint16_t *pixels, size_t count)
{
    uint16_t got[2048];
    SAME(skyloop_decompress(data, length, bits, got, count), SKYLOOP_OK);
    CHECK(memcmp(got, pixels, count * sizeof pixels[0]) == 0);
    for (size_t cut = 0U; cut < length; cut++) {
        uint8_t *copy = copied(data, cut);
        SAME(skyloop_decompress(copy, cut, bits, got, count), SKYLOOP_BAD_VALUE);
        free(copy);
    }
    for (size_t bit = 0U; bit < length * 8U; bit++) {
        uint8_t *copy = copied(data, length);
        copy[bit / 8U] ^= (uint8_t)(0x80U >> (bit % 8U));
        for (uint8_t wrong = 0U; wrong <= 17U; wrong++) {
            (void)skyloop_decompress(copy, length, wrong, got, 2048U);
            (void)skyloop_decompress(copy, length, wrong, got, count);
        }
        free(copy);
    }
}

#include "../../vectors/golden.h"

int main(void)
{
    /* the check values of the catalogue of parametrised CRC algorithms */
    const uint8_t digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    vector = "published check values";
    SAME(skyloop_crc16(digits, sizeof digits), 0x29B1U);
    SAME(skyloop_crc32(digits, sizeof digits), 0xCBF43926U);
    check_pixels();
    golden();
    (void)printf("skyloop.h: %lu checks\n", checks);
    return EXIT_SUCCESS;
}
