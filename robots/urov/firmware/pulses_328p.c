/* ATmega328P: its one 16-bit timer has two compare outputs, too few for eight channels. So one edge after the other is
   made by an interrupt that the timer calls a little early, and that waits for the right moment.

   Channel k rises at k ms and falls 1.1 to 1.9 ms later, so in each millisecond one channel rises at its start and
   the one before falls between 0.1 ms and 0.9 ms: two edges never come nearer to each other than 0.1 ms.

     ms    0        1        2        3
     ch 0  |--------+----|
     ch 1           |--------+----|
     ch 2                    |--------+----|

   The waiting loop takes 5 cycles, 0.3 us, and by as much an edge may be late; other interrupts do not move it.
   Channel 0 to 7: pins D2 to D9.

   Not mode 14 (TOP in ICR1) and no compare outputs: simavr 1.6 does neither as the silicon does. */
#include "pulses.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define SLOT (1000 * TICKS_PER_US)
#define LEAD (10 * TICKS_PER_US) /* longer than the other interrupts together take */

static uint8_t slot;               /* the millisecond of the period */
static uint16_t slot_start;        /* ticks */
static uint16_t due;               /* when the next edge is */
static uint8_t is_fall;            /* whether it is one */
static uint8_t channel;            /* its channel; CHANNELS or more: no pulse, only time passes */
static const uint8_t masks[CHANNELS] = {_BV(PD2), _BV(PD3), _BV(PD4), _BV(PD5), _BV(PD6), _BV(PD7), _BV(PB0), _BV(PB1)};

static void next_edge(void) {
    is_fall = !is_fall;
    if (is_fall) { /* after the rise of a channel the fall of the one before it, which rose a slot earlier */
        channel = (slot ? slot : PERIOD_MS) - 1;
        due = channel < CHANNELS ? slot_start - SLOT + widths[channel] : slot_start + SLOT / 2;
    } else {
        slot_start += SLOT;
        if (++slot == PERIOD_MS) {
            slot = 0;
            periods++;
        }
        channel = slot;
        due = slot_start;
    }
    OCR1A = due - LEAD;
}

ISR(TIMER1_COMPA_vect) {
    if (channel < CHANNELS) {
        volatile uint8_t *port = channel < 6 ? &PORTD : &PORTB;
        uint8_t level = is_fall ? *port & ~masks[channel] : *port | masks[channel];
        while ((int8_t)(TCNT1L - (uint8_t)due) < 0) {
        }
        *port = level;
    }
    next_edge();
}

void pulses_begin(void) {
    DDRD |= 0xff << PD2;
    DDRB |= _BV(PB0) | _BV(PB1);
    is_fall = 1; /* as if the last slot were just over */
    slot = PERIOD_MS - 1;
    next_edge();
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(CS11); /* 16 MHz / 8: a tick is half a microsecond */
}
