#include "capture.h"

#include <Arduino.h>

namespace {

constexpr int kMaxFingers = 8;
constexpr int kFingersPerTimer = 4;
constexpr int kNowChannel = 5;        // of TIMER3: where ReadTicks captures
constexpr int kFirstPpiChannel = 4;   // to 11 for the fingers; those from 20 on are wired by the manufacturer
constexpr int kStartPpiChannel = 12;  // starts both timers

// From the interrupt to loop(): one writes `head`, the other `tail`.
constexpr uint32_t kRingSize = 128;  // a power of two
CapturedEdge ring[kRingSize];
volatile uint32_t ring_head = 0;
volatile uint32_t ring_tail = 0;

int finger_count = 0;
uint32_t pin_names[kMaxFingers];  // port * 32 + pin

uint32_t Captured(int finger) {
  return finger < kFingersPerTimer ? NRF_TIMER3->CC[finger] : NRF_TIMER4->CC[finger - kFingersPerTimer];
}

// The time is the hardware's; the level is read here, a few microseconds later. Of two edges within that time
// the later one's time is kept, and if the level is the old one again the core ignores both.
void OnGpiote() {
  for (int finger = 0; finger < finger_count; ++finger) {
    if (NRF_GPIOTE->EVENTS_IN[finger] == 0) continue;
    NRF_GPIOTE->EVENTS_IN[finger] = 0;
    const uint32_t head = ring_head;
    // Full: loop() finds out by looking at the pin.
    if (head - ring_tail == kRingSize) continue;
    CapturedEdge& edge = ring[head % kRingSize];
    edge.finger = static_cast<uint8_t>(finger);
    edge.ticks = Captured(finger);
    edge.level = ReadLevel(finger);
    __DMB();
    ring_head = head + 1;
  }
}

void SetUpTimer(NRF_TIMER_Type* timer) {
  timer->TASKS_STOP = 1;
  timer->MODE = 0;       // timer
  timer->BITMODE = 3;    // 32 bits
  timer->PRESCALER = 0;  // 16 MHz
  timer->TASKS_CLEAR = 1;
}

void Connect(int channel, volatile uint32_t* event, volatile uint32_t* task) {
  NRF_PPI->CH[channel].EEP = reinterpret_cast<uint32_t>(event);
  NRF_PPI->CH[channel].TEP = reinterpret_cast<uint32_t>(task);
}

}  // namespace

void BeginCapture(const uint8_t* pins, int count) {
  // The crystal: the internal oscillator is wrong by up to 1.5 percent.
  NRF_CLOCK->EVENTS_HFCLKSTARTED = 0;
  NRF_CLOCK->TASKS_HFCLKSTART = 1;
  while (NRF_CLOCK->EVENTS_HFCLKSTARTED == 0) {
  }

  // One event starts both timers through one channel and its fork: they never differ.
  SetUpTimer(NRF_TIMER3);
  SetUpTimer(NRF_TIMER4);
  Connect(kStartPpiChannel, &NRF_EGU3->EVENTS_TRIGGERED[0], &NRF_TIMER3->TASKS_START);
  NRF_PPI->FORK[kStartPpiChannel].TEP = reinterpret_cast<uint32_t>(&NRF_TIMER4->TASKS_START);
  NRF_PPI->CHENSET = 1u << kStartPpiChannel;
  NRF_EGU3->TASKS_TRIGGER[0] = 1;

  finger_count = count < kMaxFingers ? count : kMaxFingers;
  for (int finger = 0; finger < finger_count; ++finger) {
    pinMode(pins[finger], INPUT_PULLUP);
    pin_names[finger] = static_cast<uint32_t>(digitalPinToPinName(pins[finger]));
    NRF_TIMER_Type* timer = finger < kFingersPerTimer ? NRF_TIMER3 : NRF_TIMER4;
    Connect(kFirstPpiChannel + finger, &NRF_GPIOTE->EVENTS_IN[finger],
            &timer->TASKS_CAPTURE[finger % kFingersPerTimer]);
    NRF_PPI->CHENSET = 1u << (kFirstPpiChannel + finger);
    // Event mode, both edges; bits 8 to 13 are port and pin.
    NRF_GPIOTE->CONFIG[finger] = 1u | pin_names[finger] << 8 | 3u << 16;
    NRF_GPIOTE->EVENTS_IN[finger] = 0;
    NRF_GPIOTE->INTENSET = 1u << finger;
  }
  NVIC_SetVector(GPIOTE_IRQn, reinterpret_cast<uint32_t>(&OnGpiote));
  NVIC_EnableIRQ(GPIOTE_IRQn);
}

bool TakeEdge(CapturedEdge* edge) {
  const uint32_t tail = ring_tail;
  if (tail == ring_head) return false;
  __DMB();
  *edge = ring[tail % kRingSize];
  __DMB();
  ring_tail = tail + 1;
  return true;
}

bool ReadLevel(int finger) {
  const uint32_t name = pin_names[finger];
  const NRF_GPIO_Type* port = name < 32 ? NRF_P0 : NRF_P1;
  return port->IN >> (name % 32) & 1;
}

uint32_t ReadTicks() {
  NRF_TIMER3->TASKS_CAPTURE[kNowChannel] = 1;
  return NRF_TIMER3->CC[kNowChannel];
}
