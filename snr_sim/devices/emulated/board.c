/* One microcontroller of simavr behind a few plain functions, for board.py: run for so many cycles, bytes in, bytes out,
   pulses at pins, voltages at pins. It knows nothing of the firmware, and time passes only in board_run.

   simavr is under the GPL, version 3. This file is compiled and linked with it on the machine where it is used. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <avr_adc.h>
#include <avr_extint.h>
#include <avr_ioport.h>
#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define MAX_PINS 16
#define QUEUE 65536 /* bytes that wait on either way; a power of two */
#define LOG 16384   /* pulses that have not been fetched; a power of two */

typedef struct {
    uint64_t rise; /* cycles since power on */
    uint32_t width;
    uint32_t channel;
} pulse_t;

typedef struct {
    uint64_t due; /* when the byte is over */
    uint8_t byte;
} timed_t;

typedef struct {
    uint64_t rise;  /* of the last pulse, also of one that is not over */
    uint32_t width; /* of the last one that is over */
    uint32_t count; /* of those */
} pin_t;

typedef struct board {
    avr_t *avr;
    void (*reset)(avr_t *);
    uint32_t byte_cycles;
    uint32_t resets;
    int was_reset;
    int is_feeding;   /* a byte is on its way */
    int is_full; /* simavr's UART takes no byte now */
    int pins;
    pin_t pin[MAX_PINS];
    int level[MAX_PINS];
    struct hook { struct board *board; int channel; } hooks[MAX_PINS];
    uint8_t in[QUEUE];
    uint64_t in_head, in_tail;
    timed_t out[QUEUE];
    uint64_t out_head, out_tail, lost;
    pulse_t log[LOG];
    uint64_t log_head, log_tail;
} board_t;

static board_t *resetting[64]; /* simavr's reset function takes no parameter of ours */

static void discard_log(avr_t *avr, const int level, const char *format, va_list rest)
{
    (void)avr, (void)level, (void)format, (void)rest;
}

static void sleep_no_longer_than_simulated(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr, (void)cycles;
}

static void set_level(board_t *board, int channel, int level)
{
    pin_t *pin = &board->pin[channel];
    uint64_t now = board->avr->cycle;
    if (level == board->level[channel])
        return;
    board->level[channel] = level;
    if (level) {
        pin->rise = now;
        return;
    }
    pin->width = now - pin->rise;
    pin->count++;
    if (board->log_head - board->log_tail == LOG)
        board->log_tail++;
    board->log[board->log_head++ % LOG] = (pulse_t){pin->rise, pin->width, channel};
}

static void on_pin(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct hook *hook = param;
    (void)irq;
    set_level(hook->board, hook->channel, value & 1);
}

/* A reset releases all pins, and their loads pull them low: it cuts a pulse off. (simavr does not report it.) */
static void on_reset(avr_t *avr)
{
    for (int i = 0; i < 64; i++)
        if (resetting[i] && resetting[i]->avr == avr) {
            board_t *board = resetting[i];
            board->was_reset = 1;
            board->resets++;
            for (int channel = 0; channel < board->pins; channel++)
                set_level(board, channel, 0);
            board->reset(avr);
        }
}

static void on_byte_out(struct avr_irq_t *irq, uint32_t value, void *param)
{
    board_t *board = param;
    (void)irq;
    if (board->out_head - board->out_tail == QUEUE)
        board->lost++;
    else
        board->out[board->out_head++ % QUEUE] = (timed_t){board->avr->cycle + board->byte_cycles, (uint8_t)value};
}

static void on_uart_full(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)value;
    ((board_t *)param)->is_full = 1;
}

static void on_uart_free(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)value;
    ((board_t *)param)->is_full = 0;
}

static avr_cycle_count_t on_byte_in(avr_t *avr, avr_cycle_count_t when, void *param) /* one has come over the line */
{
    board_t *board = param;
    if (board->is_full) /* it is a little slower than the line; none is lost, as none would be on silicon */
        return when + board->byte_cycles / 16;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), board->in[board->in_tail++ % QUEUE]);
    board->is_feeding = board->in_tail != board->in_head;
    return board->is_feeding ? when + board->byte_cycles : 0;
}

static void feed(board_t *board)
{
    if (!board->is_feeding && board->in_tail != board->in_head) {
        board->is_feeding = 1;
        avr_cycle_timer_register(board->avr, board->byte_cycles, on_byte_in, board);
    }
}

static avr_cycle_count_t on_stop(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr, (void)when, (void)param;
    return 0;
}

/* `pins`: for each channel a letter and a digit, "B1B2D2". Returns NULL if simavr cannot read the file or lacks the part. */
board_t *board_open(const char *elf, const char *mcu, uint32_t hz, uint32_t baud, const char *pins)
{
    int slot = 0;
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(discard_log);
    while (slot < 64 && resetting[slot])
        slot++;
    avr_t *avr = slot < 64 ? avr_make_mcu_by_name(mcu) : NULL;
    if (!avr || elf_read_firmware(elf, &firmware) != 0)
        return NULL;
    board_t *board = calloc(1, sizeof *board);
    avr_init(avr);
    firmware.frequency = hz;
    firmware.vcc = firmware.avcc = firmware.aref = 5000;
    avr_load_firmware(avr, &firmware);
    avr->frequency = hz;
    avr->log = 0;
    avr->run_cycle_limit = hz; /* of instructions at a stretch; what is due ends them sooner */
    avr->sleep = sleep_no_longer_than_simulated;
    board->avr = avr;
    board->reset = avr->reset;
    avr->reset = on_reset;
    resetting[slot] = board;
    board->byte_cycles = (hz * 10u + baud / 2) / baud;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags); /* neither to the terminal nor slowed down */
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte_out, board);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), on_uart_full, board);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), on_uart_free, board);
    for (int i = 0; pins[2 * i] && i < MAX_PINS; i++) {
        avr_irq_t *irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(pins[2 * i]), pins[2 * i + 1] - '0');
        board->hooks[i] = (struct hook){board, i};
        avr_irq_register_notify(irq, on_pin, &board->hooks[i]);
        board->pins++;
    }
    return board;
}

void board_close(board_t *board)
{
    for (int i = 0; i < 64; i++)
        if (resetting[i] == board)
            resetting[i] = NULL;
    avr_terminate(board->avr);
    free(board->avr);
    free(board);
}

/* Lets `cycles` pass. Returns the cycle at which it is now, 0 if the microcontroller has come to a halt. An instruction
   is never cut, so it may be a few more; the next call has as many less. */
uint64_t board_run(board_t *board, uint64_t until)
{
    avr_t *avr = board->avr;
    board->was_reset = 1; /* to set up what a reset takes away */
    while (avr->cycle < until) {
        if (board->was_reset) {
            board->was_reset = board->is_full = 0;
            for (int i = 0; i < 8; i++)
                avr_extint_set_strict_lvl_trig(avr, i, 0); /* or pins that could interrupt are looked at in each cycle */
            avr_cycle_timer_cancel(avr, on_stop, board);
            avr_cycle_timer_register(avr, until - avr->cycle, on_stop, board);
            if (board->is_feeding && !avr_cycle_timer_status(avr, on_byte_in, board))
                board->is_feeding = 0;
            feed(board);
        }
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            return 0;
    }
    return avr->cycle;
}

/* Puts bytes on the line, one after the other at its rate. Returns how many there was room for. */
uint32_t board_put(board_t *board, const uint8_t *bytes, uint32_t count)
{
    uint32_t taken = 0;
    while (taken < count && board->in_head - board->in_tail < QUEUE)
        board->in[board->in_head++ % QUEUE] = bytes[taken++];
    return taken;
}

/* Fetches bytes that have come, at most `room`. */
uint32_t board_get(board_t *board, uint8_t *bytes, uint32_t room)
{
    uint32_t count = 0;
    while (count < room && board->out_tail != board->out_head && board->out[board->out_tail % QUEUE].due <= board->avr->cycle)
        bytes[count++] = board->out[board->out_tail++ % QUEUE].byte;
    return count;
}

/* Fetches pulses that are over, oldest first, at most `room`. */
uint32_t board_pulses(board_t *board, pulse_t *pulses, uint32_t room)
{
    uint32_t count = 0;
    while (count < room && board->log_tail != board->log_head)
        pulses[count++] = board->log[board->log_tail++ % LOG];
    return count;
}

/* What is at each pin now. */
void board_pins(board_t *board, pin_t *pins)
{
    memcpy(pins, board->pin, board->pins * sizeof *pins);
}

void board_millivolts(board_t *board, uint32_t adc, uint32_t millivolts)
{
    avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + adc), millivolts);
}

void board_supply(board_t *board, uint32_t millivolts)
{
    board->avr->vcc = board->avr->avcc = millivolts;
}

/* Pulls the reset pin low for a moment. */
void board_reset(board_t *board)
{
    avr_t *avr = board->avr;
    avr_reset(avr);
    avr_regbit_clear(avr, avr->reset_flags.porf);
    avr_regbit_set(avr, avr->reset_flags.extrf);
}

uint32_t board_resets(board_t *board)
{
    return board->resets;
}

uint32_t board_waiting(board_t *board) /* bytes that are still to come over the line to the microcontroller */
{
    return board->in_head - board->in_tail;
}
