/* Drives eight speed controllers as a computer asks for on a serial line, and is safe without it.

     bytes -> frames.c -> handle() -> commanded[] -> follow(), once a millisecond -> pulses_*.c -> pins

   What may be asked for, in which state, and what is answered: docs/formats.md, section 8. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "frames.h"
#include "pulses.h"

#define PROTOCOL 1
#define VERSION 1, 0
#define MAX_LEASE_MS 200
#define ESC_START_MS 1500 /* a Basic ESC wants neutral for about a second before it turns */
#define DEAD_BAND (25 * TICKS_PER_US)
#define SLEW_US_PER_100MS 400
#define SLEW_PER_MS (SLEW_US_PER_100MS * TICKS_PER_US / 100)
#define DWELL_MS 50
#define HEARTBEAT_MS 50
#define MAX_SILENCE_MS 40 /* without pulses; then the watchdog is not fed any more */
#define ACK_RESERVE 80    /* bytes on the way out that telemetry leaves to answers */

enum { HELLO = 0x01, SET_WIDTHS, ARM, DISARM, EMERGENCY_STOP, CLEAR_STOP, HANG = 127, IDENT = 0x81, TELEMETRY, ACK };
enum { STARTING, DISARMED, ARMED, STOPPED };
enum { DONE, IS_STARTING, NO_COMMAND, NOT_NEUTRAL, IS_STOPPED, OTHER_SESSION, OTHER_PROTOCOL };
enum {
    F_LEASE_EXPIRED = 1, F_STOPPED = 2, F_STALE = 4, F_REPEATED = 8, F_CLAMPED = 16, F_LIMITED = 32,
    F_BAD_LENGTH = 64, F_OTHER_SESSION = 128, F_OVERRUN = 256, F_UNKNOWN_TYPE = 512,
    F_OF_COMMAND = F_STALE | F_REPEATED | F_CLAMPED, F_OF_SESSION = F_BAD_LENGTH | F_OTHER_SESSION | F_UNKNOWN_TYPE,
};

volatile uint16_t widths[CHANNELS];
volatile uint8_t periods;

static uint8_t reset_cause __attribute__((section(".noinit")));
static volatile uint8_t clock_ms; /* counted by an interrupt; wraps */
static uint32_t now_ms;           /* since the start, as far as every_millisecond() has come */

static uint8_t state = STARTING;
static uint16_t faults;
static uint16_t session, seq;
static uint32_t stamp_ms;                /* of the last command, by the computer's clock */
static uint16_t age_ms, lease_ms;        /* since it was computed; how old it may get */
static uint8_t has_command, is_in_force; /* there is one in this session; it is not too old */
static uint16_t commanded[CHANNELS];     /* by it */

static struct output {
    uint16_t width;   /* what is at the pin */
    int8_t side;      /* of neutral, where it was last driven to: 1, -1; 0 once it has stood still long enough */
    uint8_t still_ms; /* how long it has been in the dead band */
} outputs[CHANNELS];

/* Counts at A0 and A1, and of the internal reference. All are parts of the supply, whatever that is, so the pins are
   computed from the reference: a supply that sags would make a battery look full. Until it is read, 5 V is used. */
static uint16_t adc[] = {0, 0, BANDGAP_MV * 1024ul / 5000};
static uint8_t frame_count;     /* frames sent */

/* Before main: store the reset cause, and disable the watchdog, which otherwise keeps running after its reset. */
void __attribute__((naked, used, section(".init3"))) keep_reset_cause(void) {
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

/* ---- outputs ---- */

static int8_t side_of(uint16_t width) {
    return (width > NEUTRAL + DEAD_BAND) - (width < NEUTRAL - DEAD_BAND);
}

static void set_width(uint8_t channel, uint16_t width) {
    outputs[channel].width = width;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        widths[channel] = width;
    }
}

/* One millisecond of one output towards its command: not too fast, and through the dead band with a rest. */
static void follow(uint8_t channel) {
    struct output *output = &outputs[channel];
    uint16_t goal = state == ARMED ? commanded[channel] : NEUTRAL, width = output->width;
    int8_t side = side_of(width), target_side;

    if (goal == width && side == output->side && output->still_ms == 0)
        return;
    if (side || ++output->still_ms == DWELL_MS) {
        output->side = side;
        output->still_ms = 0;
    }
    if (goal == width)
        return;
    faults |= F_LIMITED;
    target_side = side_of(goal);
    if (target_side && output->side && target_side != output->side)
        goal = NEUTRAL;
    int16_t change = goal - width;
    width += change > SLEW_PER_MS ? SLEW_PER_MS : change < -SLEW_PER_MS ? -SLEW_PER_MS : change;
    set_width(channel, width);
}

static void leave_armed(uint8_t next, uint16_t fault) { /* neutral, at once and without slew */
    state = next;
    faults |= fault;
    for (uint8_t i = 0; i < CHANNELS; i++)
        set_width(i, NEUTRAL);
}

/* ---- what is sent ---- */

static void add16(uint16_t value) {
    frame_add(value);
    frame_add(value >> 8);
}

static uint8_t begin(uint8_t type, uint8_t size, uint8_t spare) { /* whether there is room */
    if (!frame_begin(size + spare))
        return 0;
    frame_add(type);
    frame_add(frame_count++);
    add16(session);
    return 1;
}

static void send_telemetry(void) {
    if (!begin(TELEMETRY, 25 + 2 * CHANNELS, ACK_RESERVE))
        return;
    add16(seq);
    add16(now_ms);
    add16(now_ms >> 16);
    frame_add(state);
    add16(faults | (bytes_lost ? F_OVERRUN : 0));
    frame_add(reset_cause);
    add16(has_command ? age_ms : UINT16_MAX);
    add16(crc_errors);
    for (uint8_t i = 0; i < 2; i++)
        add16((uint32_t)adc[i] * BANDGAP_MV / adc[2]);
    for (uint8_t i = 0; i < CHANNELS; i++)
        add16(outputs[i].width);
    frame_end();
}

static void send_ident(void) {
    static const struct { /* as it goes over the line: an AVR keeps the low byte first, and leaves no gaps */
        uint8_t protocol, major, minor, channels;
        uint16_t lowest, neutral, highest, dead_band, resolution_ns, period_us, lease_ms, esc_start_ms, slew, dwell_ms;
        char mcu[12], name[16];
    } ident = {
        PROTOCOL, VERSION, CHANNELS,
        LOWEST, NEUTRAL, HIGHEST, DEAD_BAND, 1000 / TICKS_PER_US, PERIOD_MS * 1000, MAX_LEASE_MS, ESC_START_MS,
        SLEW_US_PER_100MS, DWELL_MS, MCU_NAME, "snr_sim esc",
    };
    if (!begin(IDENT, 4 + sizeof ident, 0))
        return;
    for (uint8_t i = 0; i < sizeof ident; i++)
        frame_add(((const uint8_t *)&ident)[i]);
    frame_end();
}

static void send_ack(uint8_t to, uint8_t result) {
    if (!begin(ACK, 6, 0))
        return;
    frame_add(to);
    frame_add(result);
    frame_end();
}

/* ---- what is asked for ---- */

static uint16_t get16(const uint8_t *from) {
    return from[0] | (uint16_t)from[1] << 8;
}

static void hello(uint16_t new_session, uint8_t protocol) {
    if (protocol != PROTOCOL || new_session == 0) {
        send_ack(HELLO, protocol != PROTOCOL ? OTHER_PROTOCOL : OTHER_SESSION);
        return;
    }
    if (new_session != session) {
        if (state == ARMED)
            leave_armed(DISARMED, 0);
        session = new_session;
        has_command = is_in_force = bytes_lost = seq = 0;
        faults &= ~(F_OF_SESSION | F_OF_COMMAND);
    }
    send_ident();
}

static void take_command(const uint8_t *body) {
    uint32_t stamp = get16(body + 5) | (uint32_t)get16(body + 7) << 16;
    uint16_t number = get16(body + 3), age = get16(body + 9);
    uint16_t lease = get16(body + 11) < MAX_LEASE_MS ? get16(body + 11) : MAX_LEASE_MS;
    int32_t later_ms = stamp - stamp_ms; /* also correct when the computer's count wraps */
    uint8_t is_neutral = 1;
    for (uint8_t i = 0; i < CHANNELS; i++)
        is_neutral &= get16(body + 13 + 2 * i) == NEUTRAL;
    faults &= ~F_OF_COMMAND;
    if (has_command && (later_ms < 0 || (later_ms == 0 && (int16_t)(number - seq) <= 0)))
        faults |= F_REPEATED;
    else if (age >= lease)
        faults |= F_STALE;
    if ((faults & F_OF_COMMAND) && !is_neutral) /* neutral is taken however late it comes, but extends no lease */
        return;
    if (!(faults & F_OF_COMMAND)) {
        if (!has_command || later_ms || age > age_ms) /* the same moment does not become younger */
            age_ms = age;
        has_command = is_in_force = 1;
        seq = number;
        stamp_ms = stamp;
        lease_ms = lease;
    }
    for (uint8_t i = 0; i < CHANNELS; i++) {
        uint16_t width = get16(body + 13 + 2 * i);
        uint16_t allowed = width < LOWEST ? LOWEST : width > HIGHEST ? HIGHEST : width;
        if (allowed != width)
            faults |= F_CLAMPED;
        commanded[i] = allowed;
    }
}

static uint8_t arm(void) {
    if (state == STARTING || state == STOPPED)
        return state == STARTING ? IS_STARTING : IS_STOPPED;
    if (!is_in_force || state == ARMED)
        return is_in_force ? DONE : NO_COMMAND;
    for (uint8_t i = 0; i < CHANNELS; i++)
        if (commanded[i] != NEUTRAL)
            return NOT_NEUTRAL;
    state = ARMED;
    faults &= ~F_LEASE_EXPIRED;
    return DONE;
}

static uint8_t request(uint8_t type) {
    if (type == ARM)
        return arm();
    if (type == DISARM && state == ARMED)
        leave_armed(DISARMED, 0);
    if (type == CLEAR_STOP && state == STOPPED) {
        state = now_ms < ESC_START_MS ? STARTING : DISARMED;
        faults &= ~F_STOPPED;
    }
    return DONE;
}

static void handle(const uint8_t *body, uint8_t length) {
    uint8_t type = body[0];
    if (type == EMERGENCY_STOP) { /* from any sender, with any body: rather once too often */
        leave_armed(STOPPED, F_STOPPED);
        send_ack(type, DONE);
        return;
    }
#ifdef HANG_TEST /* for tests of the watchdog only */
    while (type == HANG && body[1] < 2) /* 0: with interrupts, 1: without, else: a register that is cleared */
        if (body[1])
            cli();
    if (type == HANG)
        *(volatile uint8_t *)(uint16_t)body[1] = 0;
#endif
    if (type < HELLO || type > CLEAR_STOP) {
        faults |= F_UNKNOWN_TYPE;
        return;
    }
    uint8_t expected = type == HELLO ? 4 : type == SET_WIDTHS ? 13 + 2 * CHANNELS : 3;
    if (type != HELLO && (length < 3 || session == 0 || get16(body + 1) != session)) {
        faults |= F_OTHER_SESSION;
        send_ack(type, OTHER_SESSION);
    } else if (length != expected) {
        faults |= F_BAD_LENGTH;
        if (type == SET_WIDTHS && state == ARMED)
            leave_armed(DISARMED, 0);
    } else if (type == HELLO)
        hello(get16(body + 1), body[3]);
    else if (type == SET_WIDTHS) {
        take_command(body);
        send_telemetry();
    } else
        send_ack(type, request(type));
}

/* ---- time ---- */

ISR(TIMER2_COMPA_vect) {
    clock_ms++;
}

static void read_adc(void) { /* fetches what was measured, and turns to the next input, which has 4 ms to settle */
    static const uint8_t inputs[] = {0, 1, BANDGAP_INPUT};
    static uint8_t input_index;
    adc[input_index] = ADC;
    input_index = (input_index + 1) % sizeof inputs;
    ADMUX = _BV(REFS0) | inputs[input_index]; /* as a part of the supply */
}

static void feed_watchdog(void) { /* as long as pulses are made */
    static uint8_t last, silent_ms;
    silent_ms = periods == last ? silent_ms + 1 : 0;
    last = periods;
    if (silent_ms < MAX_SILENCE_MS)
        wdt_reset();
}

static void every_millisecond(void) {
    static uint8_t quiet_ms;
    if (age_ms < UINT16_MAX - 1)
        age_ms++;
    if (is_in_force && age_ms >= lease_ms) {
        is_in_force = 0;
        if (state == ARMED)
            leave_armed(DISARMED, F_LEASE_EXPIRED);
    }
    if (state == STARTING && now_ms >= ESC_START_MS)
        state = DISARMED;
    faults &= ~F_LIMITED;
    for (uint8_t i = 0; i < CHANNELS; i++)
        follow(i);
    if ((now_ms & 7) == 0)
        ADCSRA |= _BV(ADSC);
    if ((now_ms & 7) == 4)
        read_adc();
    quiet_ms = is_in_force ? 0 : quiet_ms + 1;
    if (quiet_ms == HEARTBEAT_MS) {
        quiet_ms = 0;
        send_telemetry();
    }
    feed_watchdog();
}

static void sleep_until_something_happens(void) {
    cli(); /* or what happens between the question and the sleep would be slept over */
    while (!frame_ends && clock_ms == (uint8_t)now_ms) {
        sleep_enable();
        sei(); /* holds from the instruction after the next one on */
        sleep_cpu();
        sleep_disable();
        cli();
    }
    sei();
}

int main(void) {
    const uint8_t *body;
    for (uint8_t i = 0; i < CHANNELS; i++)
        widths[i] = outputs[i].width = commanded[i] = NEUTRAL;
    wdt_enable(WDTO_120MS);
    frames_begin();
    pulses_begin();
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0); /* 125 kHz */
    OCR2A = OCR2B = 249; /* B is not used; but at 0, simavr would look at it every 64 cycles */
    TCCR2A = _BV(WGM21);
    TCCR2B = _BV(CS22); /* 16 MHz / 64 / 250: a millisecond */
    TIMSK2 = _BV(OCIE2A);
    for (;;) {
        sleep_until_something_happens();
        for (uint8_t length; (length = frames_read(&body));)
            handle(body, length);
        while (clock_ms != (uint8_t)now_ms) {
            now_ms++;
            every_millisecond();
        }
    }
}
