// The core behind a pseudo-terminal of the host: an end effector for trying a gateway without
// hardware. Its fingers are pressed by calls; its times are the host's, so nothing that it reports was
// measured on anything.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>

#include "firmware/core/effector.h"

namespace touchstone::firmware {

class PtyEffector {
 public:
  // Null and an error text if there is no pseudo-terminal to be had.
  static std::unique_ptr<PtyEffector> Open(std::string* error);
  ~PtyEffector();
  PtyEffector(const PtyEffector&) = delete;
  PtyEffector& operator=(const PtyEffector&) = delete;

  const std::string& path() const { return path_; }  // what a gateway opens
  int fd() const { return master_; }                 // readable when the host has sent something

  // Handles what has arrived and what is due; never blocks. At least every millisecond.
  void Run();
  // finger from 0; a press is the level 1. One of the wrong number is ignored.
  void Press(int finger, bool pressed);
  void Sample(int finger, uint16_t value);

 private:
  PtyEffector(int master, int slave, std::string path);
  static void Write(void* context, const uint8_t* frame, size_t size);
  static uint32_t Now(void* context);  // microseconds
  void Flush();

  int master_;
  int slave_;  // kept open: without it, reading fails while no gateway is there
  std::string path_;
  std::deque<uint8_t> unsent_;
  Effector effector_;
};

}  // namespace touchstone::firmware
