/* Interrupts receive and send bytes through two rings; frames are decoded outside of interrupts.
   The rings have 256 bytes, so that an index of 8 bits wraps by itself. */
#include "frames.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/crc16.h>

#ifndef USART_RX_vect /* the ATmega2560 has four of what the ATmega328P has one */
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

uint16_t crc_errors;
volatile uint8_t bytes_lost, frame_ends;

static volatile uint8_t in[256], out[256];
static volatile uint8_t in_head, in_tail, out_head, out_tail;

void frames_begin(void) {
    UCSR0A = _BV(U2X0);
    UBRR0 = 16; /* 117647 baud, 2 % fast: as near to 115200 as 16 MHz gets, and near enough */
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect) {
    uint8_t overrun = UCSR0A & _BV(DOR0); /* to be read before the byte */
    uint8_t byte = UDR0, head = in_head;
    if (overrun || (uint8_t)(head + 1) == in_tail)
        bytes_lost = 1;
    in[head] = byte; /* too many corrupt a frame, and its CRC detects this */
    in_head = head + 1;
    if (byte == 0)
        frame_ends = 1;
}

ISR(USART_UDRE_vect) {
    uint8_t tail = out_tail;
    UDR0 = out[tail++]; /* first a byte, then perhaps off: some emulators lose the interrupt otherwise */
    out_tail = tail;
    if (tail == out_head)
        UCSR0B &= ~_BV(UDRIE0);
}

/* The frame that is being read. */
static uint8_t body[MAX_BODY], length;
static uint8_t run;      /* bytes until the next count */
static uint8_t has_zero; /* a zero is decoded at the next count, if the frame continues */
static uint8_t is_bad;
static uint16_t crc;

static void append(uint8_t byte) {
    if (length == MAX_BODY) {
        is_bad = 1;
        return;
    }
    body[length++] = byte;
    crc = _crc_xmodem_update(crc, byte);
}

static uint8_t finish(void) { /* at the zero: the length of the body, or 0 */
    uint8_t is_empty = !length && !run && !has_zero; /* two zeros, one after the other */
    uint8_t found = !run && !is_bad && length > 2 && crc == 0 ? length - 2 : 0; /* over a body and its CRC, it is 0 */
    if (!found && !is_empty && crc_errors != UINT16_MAX)
        crc_errors++;
    length = run = has_zero = is_bad = 0;
    crc = 0;
    return found;
}

uint8_t frames_read(const uint8_t **found) {
    *found = body;
    frame_ends = 0;
    while (in_head != in_tail) {
        uint8_t byte = in[in_tail], size;
        in_tail++;
        if (byte == 0) {
            if ((size = finish()))
                return size;
        } else if (run) {
            run--;
            append(byte);
        } else { /* a count */
            if (has_zero)
                append(0);
            run = byte - 1;
            has_zero = 1; /* also after 255, with which no zero goes: but such a frame is too long for us anyway */
        }
    }
    return 0;
}

/* The frame that is being sent. Its end is `head`; out_head follows when it is whole. */
static uint8_t head, count_at; /* where the count of this run of bytes belongs */
static uint16_t sum;

static void put(uint8_t byte) {
    if (byte) {
        out[head++] = byte;
        return;
    }
    out[count_at] = head - count_at;
    count_at = head++;
}

uint8_t frame_begin(uint8_t size) {
    uint8_t room = out_tail - out_head - 1;
    if (room < size + 4) /* a count, two bytes of CRC, a zero */
        return 0;
    count_at = out_head;
    head = count_at + 1;
    sum = 0;
    return 1;
}

void frame_add(uint8_t byte) {
    sum = _crc_xmodem_update(sum, byte);
    put(byte);
}

void frame_end(void) {
    put(sum >> 8);
    put(sum);
    put(0); /* fills in the last count */
    out[count_at] = 0; /* and this zero is the frame's end */
    out_head = head;
    UCSR0B |= _BV(UDRIE0);
}
