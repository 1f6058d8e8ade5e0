// Checksums of a journal's rows, and the sums that tell whether a row is missing: what is read is what was written, or
// an error says which touch is damaged. A checksum is the first 64 bits of the SHA-256 of a row's types and values
// (and of the rows that belong to it). Internal to session/.
//
// Whoever changes rows checks them first, so that no damage is sealed, and seals them afterwards, in one transaction.
// DATA_LOSS: what is stored differs from its checksum. A journal without checksums (version 1) passes every check.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// What a session's touches and images add up to.
struct SessionTally {
  int64_t touches = 0, done = 0, failed = 0;
  uint64_t touch_digest = 0;  // sum of the checksums, modulo 2^64
  int64_t images = 0;
  uint64_t image_digest = 0;
};
absl::StatusOr<SessionTally> ReadTally(SqliteFile* file, int64_t session_id);
absl::Status WriteTally(SqliteFile* file, int64_t session_id, const SessionTally& tally);

// A touch as it was sealed.
struct TouchSeal {
  uint64_t checksum = 0;
  TouchStage stage = TouchStage::kIntent;
};
absl::StatusOr<TouchSeal> CheckTouch(SqliteFile* file, int64_t touch_id);
// `before`: what CheckTouch gave; null: the touch is new.
absl::Status SealTouch(SqliteFile* file, int64_t touch_id, const TouchSeal* before, SessionTally* tally);

absl::Status CheckImage(SqliteFile* file, int64_t image_id);
absl::Status SealNewImage(SqliteFile* file, int64_t image_id, SessionTally* tally);

// A session's row and its objects.
absl::Status CheckSession(SqliteFile* file, int64_t session_id);
absl::Status SealSession(SqliteFile* file, int64_t session_id);

// The row ids of a session's touches or images in the order of their numbers. On DATA_LOSS, since they do not add up
// to the session's tally, `ids` holds those that were found.
absl::Status ReadTouchIds(SqliteFile* file, int64_t session_id, std::vector<int64_t>* ids);
absl::Status ReadImageIds(SqliteFile* file, int64_t session_id, std::vector<int64_t>* ids);

uint64_t SeriesChecksum(const JournalSeries& series);

}  // namespace touchstone::session
