/* An MS5837-30BA's compensation in C, written from the data sheet: reads docs/ms5837.csv, writes the numbers it gets.
 *
 * -DWIDE=int32_t and -DSHIFT(x,n)=((x)/(1LL<<(n))) make the two mistakes that such a port is prone to. */
#include <inttypes.h>
#include <stdio.h>

#ifndef WIDE
#define WIDE int64_t
#endif
#ifndef SHIFT
#define SHIFT(x, n) ((x) >> (n))
#endif

int main(void)
{
    char line[512];
    uint16_t c[7];
    uint32_t d1, d2;

    if (!fgets(line, sizeof line, stdin))
        return 1;
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "%" SCNu16 ",%" SCNu16 ",%" SCNu16 ",%" SCNu16 ",%" SCNu16 ",%" SCNu16 ",%" SCNu32 ",%" SCNu32,
                   c + 1, c + 2, c + 3, c + 4, c + 5, c + 6, &d1, &d2) != 8)
            return 1;
        int32_t dt = (int32_t)d2 - ((int32_t)c[5] << 8);
        int32_t temp = 2000 + (int32_t)SHIFT((WIDE)dt * c[6], 23);
        int64_t off = ((int64_t)c[2] << 16) + SHIFT((WIDE)c[4] * dt, 7);
        int64_t sens = ((int64_t)c[1] << 15) + SHIFT((WIDE)c[3] * dt, 8);
        int64_t p = SHIFT(SHIFT((WIDE)d1 * (WIDE)sens, 21) - off, 13);
        WIDE low = temp - 2000, very_low = temp + 1500;
        int64_t ti, offi, sensi;
        if (temp < 2000) {
            ti = SHIFT(3 * (WIDE)dt * dt, 33);
            offi = SHIFT(3 * low * low, 1);
            sensi = SHIFT(5 * low * low, 3);
            if (temp < -1500) {
                offi += 7 * very_low * very_low;
                sensi += 4 * very_low * very_low;
            }
        } else {
            ti = SHIFT(2 * (WIDE)dt * dt, 37);
            offi = SHIFT(low * low, 4);
            sensi = 0;
        }
        int64_t off2 = off - offi, sens2 = sens - sensi;
        int64_t p2 = SHIFT(SHIFT((WIDE)d1 * (WIDE)sens2, 21) - off2, 13);
        printf("%" PRId32 ",%" PRId32 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64
               ",%" PRId64 ",%" PRId64 ",%" PRId64 "\n",
               dt, temp, off, sens, p, ti, offi, sensi, off2, sens2, temp - ti, p2);
    }
    return 0;
}
