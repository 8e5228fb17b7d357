/* ATmega2560: three 16-bit timers with three compare outputs each make every edge by themselves (mode 14, fast PWM up
   to ICRn). All channels rise together. Channel 0 to 7: pins D2, D3, D5, D6, D7, D8, D11, D12. */
#include "pulses.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define PERIOD_TICKS (PERIOD_MS * 1000u * TICKS_PER_US)
#define BEFORE (40 * TICKS_PER_US) /* longer than the other interrupts together take */

static volatile uint16_t *const compare[CHANNELS] = {&OCR3B, &OCR3C, &OCR3A, &OCR4A, &OCR4B, &OCR4C, &OCR1A, &OCR1B};

/* Whether another timer runs beside timer 1, with which it was started. */
static uint8_t is_in_step(uint16_t count) {
    return (uint16_t)(TCNT1 - count + BEFORE / 2) < BEFORE;
}

/* Shortly before the next pulses: write the widths. The timers load them when the pulses begin. simavr loads them
   at once, so they are not written during a pulse. */
ISR(TIMER1_COMPC_vect) {
    for (uint8_t i = 0; i < CHANNELS; i++)
        *compare[i] = widths[i] - 1; /* a pulse lasts from 0 up to the match, both included */
    periods += is_in_step(TCNT3) && is_in_step(TCNT4);
}

void pulses_begin(void) {
    GTCCR = _BV(TSM) | _BV(PSRSYNC); /* the timers stand still until all are set up, then go at once */
    for (uint8_t i = 0; i < CHANNELS; i++)
        *compare[i] = widths[i] - 1;
    OCR1C = PERIOD_TICKS - BEFORE;
    ICR1 = ICR3 = ICR4 = PERIOD_TICKS - 1;
    TCNT1 = TCNT3 = TCNT4 = PERIOD_TICKS - 1000 * TICKS_PER_US; /* the first pulses in a millisecond */
    TCCR1A = TCCR3A = TCCR4A = _BV(WGM11);
    TCCR1B = TCCR3B = TCCR4B = _BV(WGM13) | _BV(WGM12) | _BV(CS11); /* 16 MHz / 8: a tick is half a microsecond */
    TCCR1A |= _BV(COM1A1) | _BV(COM1B1); /* high from the beginning, low from a match on */
    TCCR3A = TCCR4A = TCCR1A | _BV(COM1C1);
    TIMSK1 = _BV(OCIE1C);
    DDRB |= _BV(PB5) | _BV(PB6);
    DDRE |= _BV(PE3) | _BV(PE4) | _BV(PE5);
    DDRH |= _BV(PH3) | _BV(PH4) | _BV(PH5);
    GTCCR = 0;
}
