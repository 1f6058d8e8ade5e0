// Edges of the fingers' pins with the time at which the hardware saw them: GPIOTE event -> PPI -> TIMER
// capture, 16 MHz, 32 bits. TIMER1 belongs to mbed; TIMER3 and TIMER4, four fingers each, start in the same
// tick. nRF52840 only.
#pragma once

#include <stdint.h>

struct CapturedEdge {
  uint8_t finger;
  bool level;
  uint32_t ticks;
};

constexpr uint32_t kCaptureHz = 16000000;

// Once, from setup(). `pins` are Arduino's numbers, `count` at most 8.
void BeginCapture(const uint8_t* pins, int count);
// The oldest edge that was not taken yet; false if there is none. From loop() only.
bool TakeEdge(CapturedEdge* edge);
// The pin's level now.
bool ReadLevel(int finger);
// The counter now.
uint32_t ReadTicks();
