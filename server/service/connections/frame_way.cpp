#include "server/service/connections/frame_way.h"

namespace touchstone::service {

bool FrameWay::Pass(absl::string_view read, FrameReader::Admit admit, Wire* wire) {
  absl::string_view bytes = read;
  if (!pending_.empty()) {
    pending_.append(read.data(), read.size());
    bytes = pending_;
  }
  admitted_ += reader_.Pass(bytes.substr(admitted_), admit);
  size_t gone = 0;
  bool open = true;
  while (gone < admitted_) {
    const Wire::Moved moved = wire->Write(bytes.substr(gone, admitted_ - gone));
    gone += moved.bytes;
    open = moved.state != Wire::State::kEnded;
    if (moved.state != Wire::State::kMoved) break;
  }
  admitted_ -= gone;
  passed_ += gone;
  if (pending_.empty())
    pending_.assign(bytes.data() + gone, bytes.size() - gone);
  else
    pending_.erase(0, gone);
  return open;
}

}  // namespace touchstone::service
