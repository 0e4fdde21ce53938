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
