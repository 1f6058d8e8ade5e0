// One way of a connection of HTTP/2: bytes that have been read, and not been passed on yet.
#pragma once

#include <cstdint>
#include <string>

#include <absl/strings/string_view.h>

#include "server/service/connections/frame_reader.h"
#include "server/service/connections/wire.h"

namespace touchstone::service {

class FrameWay {
 public:
  // `bytes_before`: see FrameReader.
  explicit FrameWay(size_t bytes_before) : reader_(bytes_before) {}

  // Of what is read now and what waited, as much as `admit` lets through goes to `wire`; false: that has ended.
  bool Pass(absl::string_view read, FrameReader::Admit admit, Wire* wire);

  // Bytes that have not been passed on.
  std::string& pending() { return pending_; }
  // Whether the wire takes no more for now.
  bool stuck() const { return admitted_ > 0; }
  uint64_t passed() const { return passed_; }  // bytes so far
  bool between_frames() const { return pending_.empty() && reader_.between_frames(); }

 private:
  FrameReader reader_;
  std::string pending_;
  size_t admitted_ = 0;  // of pending_
  uint64_t passed_ = 0;
};

}  // namespace touchstone::service
