// What a stored session holds: a measurement file, an image set, or both. The store keeps it as one run of bytes: a
// measurement file as it is, an image set as a message behind a line that says so.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/session/measurements/measurement_set.h"
#include "touchstone/v1/diagnosis.pb.h"
#include "touchstone/v1/sessions.pb.h"

namespace touchstone::service {

// Trailing metadata of ExportSession: what of the session is not in the export, in words; absent: nothing.
inline constexpr char kLeftOutMetadata[] = "touchstone-left-out-bin";

struct StoredSession {
  std::string csv;  // the measurement file; of an image set its touches.csv. Empty: photographs alone
  std::optional<v1::ImageSetFiles> images;
};

// Whether these bytes of a store are an image set.
bool HoldsImages(absl::string_view bytes);

std::string PackSession(const StoredSession& session);
// DATA_LOSS if what the store wrote is damaged.
absl::StatusOr<StoredSession> UnpackSession(absl::string_view bytes);

// Reads the whole; errors name `origin`, file and line. Of an image set the hash is that of its files
// (session::ImageSetHash), touches.csv behind the pictures.
absl::StatusOr<v1::Session> DescribeSession(const std::string& name, absl::string_view bytes,
                                            const std::string& origin,
                                            const session::MeasurementLimits& limits = {});

// A session that comes in piece by piece, each with the file that it belongs to (CreateSessionRequest.file).
class SessionPieces {
 public:
  // INVALID_ARGUMENT: a file that another one interrupted, or a measurement file beside an image set's.
  absl::Status Append(const std::string& file, absl::string_view piece);
  uint64_t bytes() const { return bytes_; }
  uint64_t PixelBytes() const;  // as session::PixelBytes of the pictures so far
  // Packed; leaves nothing behind. INVALID_ARGUMENT if an image set has no images.csv.
  absl::StatusOr<std::string> Take();

 private:
  StoredSession session_;
  std::string* current_ = nullptr;  // where the file's pieces go
  std::string current_file_;
  bool any_ = false, has_touches_ = false;
  uint64_t bytes_ = 0;
};

// Of what a session's files are sent in, both ways.
inline constexpr size_t kSessionPieceBytes = 1 << 20;

// Hands the files of a session over in pieces of at most `piece_bytes`, until `take` returns false. `file` is empty for
// a measurement file.
absl::Status ForEachPiece(absl::string_view bytes, size_t piece_bytes,
                          const std::function<bool(const std::string& file, absl::string_view piece)>& take);

}  // namespace touchstone::service
