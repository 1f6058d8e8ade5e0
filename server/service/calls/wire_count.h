// What a serialized message would become, counted without making it: a few bytes on the wire can stand for a hundred times
// as many in memory.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>

namespace touchstone::service {

struct WireCount {
  uint64_t elements = 0;                                             // messages, texts and unknown fields
  uint64_t numbers = 0;                                              // in repeated fields
  std::map<const google::protobuf::Descriptor*, uint64_t> messages;  // by their type

  // Of a type by its full name, "touchstone.v1.CommandedTouch".
  uint64_t Messages(const std::string& type) const;
};

// False where these are not the bytes of such a message; what was counted until there stands in `count`.
bool CountWire(google::protobuf::io::CodedInputStream* input, const google::protobuf::Descriptor* type,
               WireCount* count);

}  // namespace touchstone::service
