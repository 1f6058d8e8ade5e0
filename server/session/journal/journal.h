// The session store of a rig: one SQLite file (WAL, synchronous FULL). Every touch is written as intent
// before anything moves, as executing when its program is sent, and as result before a client hears of it;
// each step is on the disk when the function returns. A file that was exported is a journal too, and can be
// served again.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/base/numbers/nan.h"

namespace touchstone::session {

enum class TouchStage {
  kIntent = 1,     // written down; nothing has moved
  kExecuting = 2,  // its program was sent: after an interruption, unknown until it is reconciled
  kDone = 3,       // has its result
  kFailed = 4      // ended without a result, for `error`; may be tried again under the same id
};

// One finger's part of a result. NaN where it is unknown.
struct JournalFinger {
  double contact_time_s = 0;              // since the approach began; NaN: reported nothing
  std::array<double, 6> base_from_tip{};  // position (m) and rotation vector (rad) at its contact
  uint64_t ticks = 0;
};

struct JournalResult {
  std::vector<JournalFinger> fingers;
  double speed_m_s = 0;  // measured; 0: unknown
  double session_time_s = 0;
  double start_unix_s = 0;
  double time_uncertainty_s = 0, synchronisation_uncertainty_s = 0, effector_drift = 0;
  bool recovered = false;
};

struct JournalTouch {
  std::string id;       // the client's
  uint64_t number = 0;  // in its session, in the order of the intents, from 0
  std::string object;
  std::string up_face;  // face of the object's box that pointed up: "+z"
  // Serialised touchstone.v1.CommandedTouch (command_bytes.h): what says whether an id is used again.
  std::string command;
  TouchStage stage = TouchStage::kIntent;
  int attempt = 1;
  uint32_t program_id = 0, boot_id = 0;  // of the arm's program and of the end effector, while executing
  JournalResult result;                  // if done
  std::string error;                     // if failed
  std::optional<int> round, face;        // of a measurement file that was imported
};

// How a picture was taken, as an image set has it. Metres, radians, object frame where nothing else is said.
struct JournalView {
  std::array<double, 3> eye_m{}, at_m{}, up{};  // as it was commanded
  std::array<double, 6> base_from_object{};     // position (m) and rotation vector (rad)
  double session_time_s = kNaN;                 // NaN: unknown
  // The camera's lens for a picture of this size, as OpenCV writes it: pixel centres lie at integers.
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  std::vector<double> distortion;  // k1 k2 p1 p2 k3 ...; empty: none
};

struct JournalImage {
  std::string id;  // the client's, or made
  uint64_t number = 0;
  std::string object;
  std::string up_face;                       // face of the object's box that pointed up: "+z"
  std::array<double, 6> base_from_camera{};  // as commanded: position (m) and rotation vector (rad)
  // As the arm measured it, and when; NaN: unknown.
  std::array<double, 6> measured_base_from_camera = {kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};
  double measured_unix_s = kNaN;
  double unix_s = 0;
  int width = 0, height = 0;
  std::string png;
  std::optional<JournalView> view;  // none: journalled before views were kept
};

// What was recorded during a touch: the bytes of its columns, and how they stand there.
struct JournalSeries {
  std::string encoding;
  std::string columns;
};

// Where a session's time began, on the clock of one boot of a host; rig/watches/session_clock.h.
struct JournalClock {
  std::string boot_id;  // empty: none was written
  double origin_s = 0;
};

struct JournalSession {
  // In this journal: greater than those of all sessions that were made before and are still there.
  int64_t id = 0;
  std::string name;
  double created_unix_s = 0;
  std::string provenance;   // "UR3e at 192.168.0.10, nano33ble 0.1.0 at /dev/ttyACM0"
  bool emulated = false;    // an emulator was in the rig's place: what it made measures nothing
  std::string calibration;  // the calibration file, whole
  int fingers = 3;
  double spacing_m = 0.03;
  uint64_t touches = 0, done = 0, failed = 0, images = 0;
  std::vector<std::string> objects;  // of the touches, in order of appearance
  double deleted_unix_s = 0;         // when it was moved to the trash; 0: it was not
  std::string deleted_by;
};

// A session with all that it has.
struct SessionContent {
  JournalSession session;
  std::vector<JournalTouch> touches;
  std::vector<std::optional<JournalSeries>> series;  // one entry per touch, or none
  std::vector<JournalImage> images;
};

// One connection, guarded by a mutex: all functions may be called from any thread.
class Journal {
 public:
  enum class Mode { kReadWrite, kCreateOrReadWrite, kReadOnly };
  // Errors say whether the file is missing, is no journal, or is of another version. Another process that has
  // it open for writing is an error too (one gateway per journal).
  // A journal of version 1 has no checksums: it is read as it is, and gets them when it is opened for writing. One of
  // version 2 has no views, and becomes version 3 likewise.
  // Every other row is checked when it is read; DATA_LOSS names the touch that is damaged. With `skip_damaged`, for
  // reading only, a touch or picture that is damaged or missing is told to it and left out.
  using SkipDamaged = std::function<void(const absl::Status&)>;
  static absl::StatusOr<std::unique_ptr<Journal>> Open(const std::string& path, Mode mode,
                                                       SkipDamaged skip_damaged = nullptr);
  virtual ~Journal() = default;

  virtual bool has_checksums() const = 0;

  // Makes the session, or does nothing if it is there with the same fingers and spacing.
  virtual absl::Status EnsureSession(const JournalSession& session) = 0;
  virtual absl::StatusOr<std::vector<JournalSession>> Sessions() const = 0;
  virtual absl::StatusOr<JournalSession> Session(const std::string& name) const = 0;
  virtual absl::StatusOr<bool> HasSession(const std::string& name) const = 0;
  virtual absl::Status SetSessionClock(const std::string& name, const JournalClock& clock) = 0;
  virtual absl::StatusOr<JournalClock> SessionClock(const std::string& name) const = 0;

  // Moves it to the trash; its name is free then. No touch of it may be executing.
  virtual absl::Status DeleteSession(const std::string& name, const std::string& by) = 0;
  // Those in the trash, the one deleted last first.
  virtual absl::StatusOr<std::vector<JournalSession>> DeletedSessions() const = 0;
  // The one of that name that was deleted last. ALREADY_EXISTS if there is one of that name again.
  virtual absl::Status RestoreSession(const std::string& name) = 0;
  // Ends every session of that name in the trash, for good, with its touches and images.
  virtual absl::Status PurgeSession(const std::string& name) = 0;

  // Begins a touch: writes the intent and returns it. If the id is there with the same object and command:
  // the touch as it stands, kDone ones without change, kFailed ones as a new intent with attempt + 1. Another
  // object or command: ALREADY_EXISTS. kIntent or kExecuting: ABORTED, since it is under way or not yet
  // reconciled.
  virtual absl::StatusOr<JournalTouch> Begin(const std::string& session, const std::string& id,
                                             const std::string& object, const std::string& up_face,
                                             const std::string& command) = 0;
  // Begin and Executing in one step, that is one commit: nothing can come between the two, and nothing may be sent
  // to the arm before it is done.
  virtual absl::StatusOr<JournalTouch> BeginExecuting(const std::string& session, const std::string& id,
                                                      const std::string& object, const std::string& up_face,
                                                      const std::string& command, uint32_t program_id,
                                                      uint32_t boot_id) = 0;
  virtual absl::Status Executing(const std::string& session, const std::string& id, uint32_t program_id,
                                 uint32_t boot_id) = 0;
  virtual absl::Status Done(const std::string& session, const std::string& id, const JournalResult& result,
                            const JournalSeries* series = nullptr) = 0;
  virtual absl::Status Failed(const std::string& session, const std::string& id,
                              const std::string& error) = 0;

  // A session that was made elsewhere with all that it has, in one step, or nothing of it. Touches and pictures as
  // AddFinished and AddImage take them; touches keep numbers that rise from one to the next. ALREADY_EXISTS if there is
  // one of its name.
  virtual absl::Status AddSession(const SessionContent& content) = 0;
  // Touches that were made elsewhere, kDone or kFailed, in the order of their approaches: all in one step, or
  // none. Their numbers are given anew, after those that are there. ALREADY_EXISTS names an id that is.
  // `series` has one entry per touch, or none.
  virtual absl::Status AddFinished(const std::string& session, const std::vector<JournalTouch>& touches,
                                   const std::vector<std::optional<JournalSeries>>& series = {}) = 0;

  virtual absl::StatusOr<std::optional<JournalTouch>> Find(const std::string& session,
                                                           const std::string& id) const = 0;
  // What was recorded during it; none: that was not asked for.
  virtual absl::StatusOr<std::optional<JournalSeries>> Series(const std::string& session,
                                                              const std::string& id) const = 0;
  // The touch that is done with the highest number.
  virtual absl::StatusOr<std::optional<JournalTouch>> LastDone(const std::string& session) const = 0;
  // In the order of their approaches (number of the intent of the attempt that was done); `each` returns
  // false to end.
  virtual absl::Status ForEachTouch(const std::string& session,
                                    const std::function<bool(const JournalTouch&)>& each) const = 0;
  // Every session's touches that are kIntent or kExecuting: what an interruption left behind.
  virtual absl::StatusOr<std::vector<std::pair<std::string, JournalTouch>>> Unfinished() const = 0;

  virtual absl::Status AddImage(const std::string& session, const JournalImage& image) = 0;
  virtual absl::Status ForEachImage(const std::string& session,
                                    const std::function<bool(const JournalImage&)>& each) const = 0;

  // Copies a session with all that it has into another journal (which must not have one of that name).
  virtual absl::Status CopySession(const std::string& name, Journal* to) const = 0;

  // What a rig remembers beyond its process: "mounted_object", "next_program_id". Several in one step, or none.
  virtual absl::Status SetMetadata(const std::vector<std::pair<std::string, std::string>>& values) = 0;
  absl::Status SetMetadata(const std::string& key, const std::string& value) {
    return SetMetadata({{key, value}});
  }
  virtual absl::StatusOr<std::string> Metadata(const std::string& key) const = 0;  // "" if it is not there
};

}  // namespace touchstone::session
