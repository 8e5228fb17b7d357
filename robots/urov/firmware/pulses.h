/* Pulses for eight speed controllers. Widths count half microseconds: 3000 is 1500 us.
   Two files implement this interface, one per microcontroller: pulses_328p.c and pulses_2560.c. */
#pragma once
#include <stdint.h>

#define CHANNELS 8
#define TICKS_PER_US 2
#define LOWEST (1100 * TICKS_PER_US)
#define NEUTRAL (1500 * TICKS_PER_US)
#define HIGHEST (1900 * TICKS_PER_US)

/* How often each channel has a pulse. 8 ms are as quick as eight channels of an ATmega328P can be; a Basic ESC takes
   up to 400 a second. For servos that want 50: make PERIOD_MS=20. */
#ifndef PERIOD_MS
#define PERIOD_MS 8
#endif
#if PERIOD_MS < 8 || PERIOD_MS > 30
#error PERIOD_MS must be from 8 to 30
#endif

extern volatile uint16_t widths[CHANNELS]; /* of each channel's next pulses; to be written without interruption */
extern volatile uint8_t periods;           /* counts them, which shows that pulses are still generated */

void pulses_begin(void);
