// The end effector on an Arduino Nano 33 BLE: the portable core between the pins and the serial line.
//
// Finger i: switch or interrupter at pin D(2 + i), pulled up; variable resistor at A(i). Which of them counts is the
// host's choice. The line is the USB port; with TOUCHSTONE_UART defined, Serial1 at 115,200 baud.
#include "capture.h"
#include "firmware/core/effector.h"

using touchstone::firmware::Effector;
using touchstone::firmware::Identity;
using touchstone::firmware::kMaxFingers;

namespace {

const uint8_t kPins[kMaxFingers] = {2, 3, 4, 5, 6, 7, 8, 9};
const uint8_t kAnaloguePins[kMaxFingers] = {A0, A1, A2, A3, A4, A5, A6, A7};
constexpr uint32_t kBytesPerLoop = 8;  // written to a UART at once: 0.7 ms at 115,200 baud

// What waits for the line. A frame that does not fit is dropped as a whole: the core repeats what matters.
uint8_t outgoing[1024];
uint32_t outgoing_head = 0;
uint32_t outgoing_tail = 0;

void WriteFrame(void*, const uint8_t* frame, size_t size) {
  if (sizeof(outgoing) - (outgoing_head - outgoing_tail) < size) return;
  for (size_t i = 0; i < size; ++i) outgoing[outgoing_head++ % sizeof(outgoing)] = frame[i];
}

// Sends some of it; never waits for a host that does not read.
void FlushSome() {
#ifdef TOUCHSTONE_UART
  for (uint32_t i = 0; i < kBytesPerLoop && outgoing_tail != outgoing_head; ++i) {
    Serial1.write(outgoing[outgoing_tail++ % sizeof(outgoing)]);
  }
#else
  const uint32_t at = outgoing_tail % sizeof(outgoing);
  const uint32_t waiting = outgoing_head - outgoing_tail;
  const uint32_t size = waiting < sizeof(outgoing) - at ? waiting : sizeof(outgoing) - at;
  uint32_t sent = 0;
  if (size > 0 && Serial) Serial.send_nb(outgoing + at, size, &sent, true);
  outgoing_tail += sent;
#endif
}

int ReadByte() {
#ifdef TOUCHSTONE_UART
  return Serial1.available() > 0 ? Serial1.read() : -1;
#else
  return Serial.available() > 0 ? Serial.read() : -1;
#endif
}

uint32_t ReadCounter(void*) { return ReadTicks(); }

// Another number after every reset, from the chip's noise.
uint32_t DrawBootId() {
  uint32_t id = 0;
  NRF_RNG->TASKS_START = 1;
  for (int i = 0; i < 4; ++i) {
    NRF_RNG->EVENTS_VALRDY = 0;
    while (NRF_RNG->EVENTS_VALRDY == 0) {
    }
    id = id << 8 | (NRF_RNG->VALUE & 0xFF);
  }
  NRF_RNG->TASKS_STOP = 1;
  return id;
}

Identity MakeIdentity() {
  Identity identity;
  identity.boot_id = DrawBootId();
  identity.tick_hz = kCaptureHz;
  identity.tick_bits = 32;
  identity.firmware = "nano33ble 0.1.0";
  return identity;
}

Effector* effector = nullptr;
bool told_level[kMaxFingers];
int next_analogue = 0;

// Edges in the order of their capture, finger by finger; then pins whose edge was lost, if ever.
void HandleEdges() {
  CapturedEdge edge;
  while (TakeEdge(&edge)) {
    told_level[edge.finger] = edge.level;
    effector->OnEdge(edge.finger, edge.level, edge.ticks);
  }
  for (int finger = 0; finger < kMaxFingers; ++finger) {
    const uint32_t now = ReadTicks();
    const bool level = ReadLevel(finger);
    if (level == told_level[finger]) continue;
    // Its interrupt may have come in this moment: then the captured time is the right one.
    if (TakeEdge(&edge)) {
      told_level[edge.finger] = edge.level;
      effector->OnEdge(edge.finger, edge.level, edge.ticks);
      continue;
    }
    told_level[finger] = level;
    effector->OnEdge(finger, level, now);
  }
}

}  // namespace

void setup() {
#ifdef TOUCHSTONE_UART
  Serial1.begin(115200);
#else
  Serial.begin(115200);
#endif
  analogReadResolution(10);
  BeginCapture(kPins, kMaxFingers);
  static Effector the_effector(MakeIdentity(), &WriteFrame, &ReadCounter, nullptr);
  effector = &the_effector;
  for (int finger = 0; finger < kMaxFingers; ++finger) {
    told_level[finger] = ReadLevel(finger);
    effector->OnEdge(finger, told_level[finger], ReadTicks());
  }
}

void loop() {
  // Edges before bytes: a request sees the fingers as they are.
  HandleEdges();
  for (int i = 0, byte; i < 64 && (byte = ReadByte()) >= 0; ++i) effector->OnByte(static_cast<uint8_t>(byte));

  // One analogue finger a turn; each is sampled many times a millisecond.
  const uint32_t before = ReadTicks();
  const uint16_t value = static_cast<uint16_t>(analogRead(kAnaloguePins[next_analogue]));
  effector->OnAnalogue(next_analogue, value, before + (ReadTicks() - before) / 2);
  next_analogue = (next_analogue + 1) % kMaxFingers;

  HandleEdges();
  effector->OnTime();
  FlushSome();
}
