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
