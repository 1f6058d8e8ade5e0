// The portable checks on an emulated Cortex-M4F: start-up, semihosting (text and exit code), and the
// list of checks.
#include <cstddef>
#include <cstdint>

#include "firmware/core/portable_checks.h"

extern "C" {
extern uint32_t data_begin[], data_end[], data_load[], bss_begin[], bss_end[], stack_top[];
extern void (*init_begin[])();
extern void (*init_end[])();
void ResetHandler();
}

namespace {

// The text of vectors.txt.
#include "vectors.inc"

uint32_t Semihost(uint32_t operation, const void* argument) {
  register uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}
void Print(const char* text) {
  Semihost(0x04, text);
}  // SYS_WRITE0
[[noreturn]] void Exit(uint32_t status) {
  const uint32_t arguments[2] = {0x20026, status};  // ADP_Stopped_ApplicationExit
  Semihost(0x20, arguments);                        // SYS_EXIT_EXTENDED
  for (;;) {
  }
}

void PrintNumber(int number) {
  char digits[12];
  char* at = digits + sizeof(digits) - 1;
  *at = 0;
  do {
    *--at = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number > 0);
  Print(at);
}

void Fault() {
  Print("A fault of the processor.\n");
  Exit(3);
}

using Handler = void (*)();
__attribute__((section(".vectors"), used)) const Handler kHandlers[16] = {
    reinterpret_cast<Handler>(stack_top),
    ResetHandler,
    Fault,
    Fault,
    Fault,
    Fault,
    Fault,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    Fault,
    Fault,
    nullptr,
    Fault,
    Fault,
};

[[noreturn]] void RunChecks() {
  using namespace touchstone::firmware;
  int failed = 0;
  for (int i = 0; i < kPortableCheckCount; ++i) {
    const char* failure = kPortableChecks[i].run(kVectors);
    Print(failure == nullptr ? "ok      " : "FAILED  ");
    Print(kPortableChecks[i].name);
    if (failure != nullptr) {
      Print(": ");
      Print(failure);
      ++failed;
    }
    Print("\n");
  }
  PrintNumber(kPortableCheckCount - failed);
  Print(" passed on Cortex-M4F, ");
  PrintNumber(failed);
  Print(" failed\n");
  Exit(failed == 0 && kPortableCheckCount > 0 ? 0 : 1);
}

}  // namespace

extern "C" void ResetHandler() {
  // The floating-point unit first: the compiler may use its registers anywhere.
  *reinterpret_cast<volatile uint32_t*>(0xE000ED88) |= 0xFu << 20;
  asm volatile("dsb\nisb");
  for (uint32_t *to = data_begin, *from = data_load; to < data_end;) *to++ = *from++;
  for (uint32_t* to = bss_begin; to < bss_end;) *to++ = 0;
  for (void (**init)() = init_begin; init < init_end; ++init) (*init)();
  RunChecks();
}
