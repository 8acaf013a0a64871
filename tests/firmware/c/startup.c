// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file Vectors, start of the floating-point unit, memory, and the end of the emulation by semihosting.

#include <stdint.h>

extern uint32_t stack_top, data_start, data_end, data_image, bss_start, bss_end;
int run(void);

__attribute__((noreturn)) static void finish(int code)
{
    // SYS_EXIT_EXTENDED with ADP_Stopped_ApplicationExit.
    const uint32_t block[2] = {0x20026, (uint32_t)code};
    for (;;) {
        register uint32_t operation __asm__("r0") = 0x20;
        register const uint32_t *argument __asm__("r1") = block;
        __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
    }
}

__attribute__((noreturn)) static void fault(void)
{
    finish(100);
}

__attribute__((noreturn)) void reset(void)
{
    // Coprocessors 10 and 11 before any floating-point instruction.
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
    for (uint32_t *to = &data_start, *from = &data_image; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;)
        *to++ = 0;
    finish(run());
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault,
};
