#include "client/cli/rig/record.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <chrono>
#include <filesystem>

#include "client/cli/session/journal_session.h"
#include "server/base/status.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/recorded/base_pose.h"
#include "server/session/recorded/touch_series.h"

namespace touchstone::cli {

absl::StatusOr<std::string> JournalPathOf(const std::string& output) {
  if (absl::EndsWith(output, ".db")) return output;
  if (absl::EndsWith(output, ".csv")) return std::filesystem::path(output).replace_extension(".db").string();
  return absl::InvalidArgumentError(absl::StrCat(
      "-o: '", output,
      "' does not say the format; its name ends in .db (a journal, resumable) or .csv (a measurement "
      "file, with the journal beside it)"));
}

session::JournalResult ResultOfMessage(const v1::TouchResult& message) {
  session::JournalResult result;
  const v1::Measured& measured = message.measured();
  for (int i = 0; i < message.contact_time_s_size(); ++i) {
    session::JournalFinger finger;
    finger.contact_time_s = message.contact_time_s(i);
    finger.base_from_tip = session::ParseBasePose(
        i < measured.base_from_tip_at_contact_size() ? measured.base_from_tip_at_contact(i) : v1::BasePose());
    result.fingers.push_back(finger);
  }
  result.speed_m_s = measured.speed_m_s();
  result.session_time_s = measured.session_time_s();
  result.start_unix_s = measured.start_unix_s();
  result.time_uncertainty_s = measured.time_uncertainty_s();
  result.synchronisation_uncertainty_s = measured.synchronisation_uncertainty_s();
  result.effector_drift = measured.effector_drift();
  result.recovered = measured.recovered();
  return result;
}

absl::StatusOr<std::unique_ptr<RigRecord>> RigRecord::Open(const std::string& path,
                                                           const std::string& session,
                                                           const v1::RigState& rig) {
  std::unique_ptr<RigRecord> record(new RigRecord);
  record->session_ = session;
  TOUCHSTONE_ASSIGN_OR_RETURN(record->journal_,
                              session::Journal::Open(path, session::Journal::Mode::kCreateOrReadWrite));
  session::JournalSession head;
  head.name = session;
  head.created_unix_s =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  head.provenance = rig.provenance();
  head.emulated = rig.emulated();
  head.calibration = rig.calibration();
  if (rig.fingers() > 0) head.fingers = static_cast<int>(rig.fingers());
  if (rig.spacing_m() > 0) head.spacing_m = rig.spacing_m();
  TOUCHSTONE_RETURN_IF_ERROR(record->journal_->EnsureSession(head));
  return record;
}

absl::StatusOr<bool> RigRecord::Has(const std::string& id, const client::MeasuredTouch& touch) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<session::JournalTouch> found, journal_->Find(session_, id));
  if (!found.has_value()) return false;
  if (found->object != touch.object ||
      !session::SameCommand(found->command, session::CommandBytes(touch.commanded)))
    return absl::AlreadyExistsError(
        absl::StrCat("session '", session_, "' has another touch ", touch.touch, " of ", touch.object,
                     " than the plan: the plan was changed; choose another --session or output"));
  return found->stage == session::TouchStage::kDone;
}

absl::Status RigRecord::Begin(const std::string& id, const client::MeasuredTouch& touch,
                              const std::string& up_face) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<session::JournalTouch> found, journal_->Find(session_, id));
  // This process was killed while it waited for the result; the source knows what became of it and answers
  // under the id.
  if (found.has_value() &&
      (found->stage == session::TouchStage::kIntent || found->stage == session::TouchStage::kExecuting))
    TOUCHSTONE_RETURN_IF_ERROR(
        journal_->Failed(session_, id, "the command was interrupted; the source is asked again"));
  TOUCHSTONE_RETURN_IF_ERROR(
      journal_->Begin(session_, id, touch.object, up_face, session::CommandBytes(touch.commanded)).status());
  return journal_->Executing(session_, id, 0, 0);
}

absl::Status RigRecord::Done(const std::string& id, const v1::TouchResult& result) {
  if (!result.measured().has_series()) return journal_->Done(session_, id, ResultOfMessage(result));
  const session::JournalSeries series{session::kSeriesEncoding,
                                      result.measured().series().SerializeAsString()};
  return journal_->Done(session_, id, ResultOfMessage(result), &series);
}

absl::Status RigRecord::Failed(const std::string& id, const absl::Status& why) {
  return journal_->Failed(session_, id, std::string(why.message()));
}

absl::StatusOr<std::vector<client::MeasuredTouch>> RigRecord::Touches() const {
  return TouchesOf(*journal_, session_);
}

}  // namespace touchstone::cli
