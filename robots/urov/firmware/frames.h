/* Frames on the serial line: COBS, a CRC, a zero. docs/formats.md, section 8, says every byte. */
#pragma once
#include <stdint.h>

#define MAX_BODY 96 /* bytes, with the CRC */

extern uint16_t crc_errors;         /* frames that were damaged; stays at 65535 */
extern volatile uint8_t bytes_lost; /* set when a byte came before the last one was fetched */
extern volatile uint8_t frame_ends; /* set when a frame has ended that was not yet decoded */

void frames_begin(void); /* 115200 baud */

/* Looks at what has come. Returns the length of the next whole, undamaged body, without its CRC; 0 if there is none. */
uint8_t frames_read(const uint8_t **body);

/* Sends a frame: begin, each byte of the body, end. It never waits: without room for `length` bytes, begin says 0. */
uint8_t frame_begin(uint8_t length);
void frame_add(uint8_t byte);
void frame_end(void);
