// Just enough names of Arduino and of the nRF52840 for a syntax check of the sketch. Written by hand from the
// public documentation; that it compiles against this says nothing about a real board.
#pragma once

#include <stddef.h>
#include <stdint.h>

constexpr int INPUT_PULLUP = 2;
constexpr uint8_t A0 = 14, A1 = 15, A2 = 16, A3 = 17, A4 = 18, A5 = 19, A6 = 20, A7 = 21;
typedef int PinName;
void pinMode(int pin, int mode);
PinName digitalPinToPinName(int pin);
int analogRead(int pin);
void analogReadResolution(int bits);

struct StubSerial {
  void begin(unsigned long baud);
  int available();
  int read();
  size_t write(uint8_t byte);
  bool send_nb(uint8_t* buffer, uint32_t size, uint32_t* sent, bool now);
  operator bool();
};
extern StubSerial Serial, Serial1;

struct NRF_TIMER_Type {
  volatile uint32_t TASKS_START, TASKS_STOP, TASKS_CLEAR, TASKS_CAPTURE[6], MODE, BITMODE, PRESCALER, CC[6];
};
struct NRF_GPIO_Type {
  volatile uint32_t IN;
};
struct NRF_GPIOTE_Type {
  volatile uint32_t EVENTS_IN[8], INTENSET, CONFIG[8];
};
struct NRF_PPI_Type {
  volatile uint32_t CHENSET;
  struct {
    volatile uint32_t EEP, TEP;
  } CH[20];
  struct {
    volatile uint32_t TEP;
  } FORK[32];
};
struct NRF_EGU_Type {
  volatile uint32_t TASKS_TRIGGER[16], EVENTS_TRIGGERED[16];
};
struct NRF_CLOCK_Type {
  volatile uint32_t TASKS_HFCLKSTART, EVENTS_HFCLKSTARTED;
};
struct NRF_RNG_Type {
  volatile uint32_t TASKS_START, TASKS_STOP, EVENTS_VALRDY, VALUE;
};
extern NRF_TIMER_Type *NRF_TIMER3, *NRF_TIMER4;
extern NRF_GPIO_Type *NRF_P0, *NRF_P1;
extern NRF_GPIOTE_Type* NRF_GPIOTE;
extern NRF_PPI_Type* NRF_PPI;
extern NRF_EGU_Type* NRF_EGU3;
extern NRF_CLOCK_Type* NRF_CLOCK;
extern NRF_RNG_Type* NRF_RNG;
enum IRQn_Type { GPIOTE_IRQn = 6 };
void NVIC_SetVector(IRQn_Type irq, uint32_t vector);
void NVIC_EnableIRQ(IRQn_Type irq);
void __DMB();
