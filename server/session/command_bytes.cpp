#include "server/session/command_bytes.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

namespace touchstone {

std::string CommandBytes(const v1::CommandedTouch& command) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    command.SerializeToCodedStream(&coded);
  }
  return bytes;
}

std::optional<v1::CommandedTouch> ParseCommandBytes(const std::string& bytes) {
  v1::CommandedTouch command;
  if (!command.ParseFromString(bytes)) return std::nullopt;
  return command;
}

bool SameCommand(const std::string& a, const std::string& b) {
  if (a == b) return true;
  const auto first = ParseCommandBytes(a), second = ParseCommandBytes(b);
  return first && second && CommandBytes(*first) == CommandBytes(*second);
}

}  // namespace touchstone
