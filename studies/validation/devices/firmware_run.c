/* Decodes rows.bin into answers.bin: on this machine, or on a Cortex-M4F in QEMU without a library but math.h.
 *
 * A row is the readings and seconds, float: NaN for a single reading (magtip_decode), 0 at the beginning of a time
 * series (magtip_step); a decoder that takes a temperature has it behind. An answer is that of magtip_decoder.h, the number of instructions and the bytes of stack, which
 * are 0 on this machine.
 */
#include "magtip_decoder.h"

#ifdef MAGTIP_THERMAL
#define ROW (MAGTIP_ELEMENTS + 2)
#else
#define ROW (MAGTIP_ELEMENTS + 1)
#endif

static magtip_sensor sensor;
static struct {
    magtip_answer answer;
    uint32_t instructions, stack;
} result;

static void decode(const float row[ROW]) __attribute__((noinline));
static void decode(const float row[ROW]) {
    if (row[MAGTIP_ELEMENTS] == 0.0f) magtip_set_up(&sensor);
#ifdef MAGTIP_THERMAL
    magtip_set_temperature(&sensor, row[MAGTIP_ELEMENTS + 1]);
#endif
    if (isnan(row[MAGTIP_ELEMENTS]))
        magtip_decode(&sensor, row, &result.answer);
    else
        magtip_step(&sensor, row, row[MAGTIP_ELEMENTS], &result.answer);
}

#ifndef __arm__
#include <stdio.h>

int main(void) {
    float row[ROW];
    FILE *rows = fopen("rows.bin", "rb"), *answers = fopen("answers.bin", "wb");
    if (rows == NULL || answers == NULL) return 2;
    magtip_set_up(&sensor);
    while (fread(row, sizeof row, 1, rows) == 1) {
        decode(row);
        if (fwrite(&result, sizeof result, 1, answers) != 1) return 3;
    }
    return fclose(answers) == 0 ? 0 : 3;
}
#else

/* files of the machine that runs QEMU, by semihosting */
static int host(int operation, const void *arguments) {
    register int r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = arguments;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static uint32_t file(const char *name, uint32_t mode, uint32_t length) {
    const uint32_t arguments[3] = {(uint32_t)name, mode, length};
    return (uint32_t)host(1, arguments);
}

/* with -icount shift=10 an instruction takes 1024 ns, which are 25.6 ticks of the timer at 25 MHz */
#define TIMER ((volatile uint32_t *)0xE000E010)

static uint32_t instructions(const float *row) {
    TIMER[1] = 0xFFFFFF;
    TIMER[2] = 0;
    TIMER[0] = 5;
    decode(row);
    return (uint32_t)((float)(0xFFFFFF - (TIMER[2] & 0xFFFFFF)) / 25.6f + 0.5f);
}

/* a pattern is laid below this frame, and looked for after */
#define DEEP 8192
static volatile uint8_t *below(void) { return (uint8_t *)__builtin_frame_address(0) - 256 - DEEP; }

static int run(void) __attribute__((noinline));
static int run(void) {
    uint32_t in, out, i;
    float row[ROW];
    in = file("rows.bin", 1, 8);
    out = file("answers.bin", 5, 11);
    magtip_set_up(&sensor);
    for (;;) {
        const uint32_t read[3] = {in, (uint32_t)row, sizeof row}, write[3] = {out, (uint32_t)&result, sizeof result};
        if (host(6, read) != 0) break;
        for (i = 0; i < DEEP; i++) below()[i] = 0xA5;
        result.instructions = instructions(row);
        for (i = 0; i < DEEP && below()[i] == 0xA5; i++) {}
        result.stack = DEEP + 256 - i;
        if (host(5, write) != 0) break;
    }
    return host(0x18, (const void *)0x20026);
}

int reset(void) {
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* the floating-point unit */
    __asm volatile("dsb; isb");
    return run();
}

extern char stack_end[];
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {stack_end, (const void *)reset};
#endif
