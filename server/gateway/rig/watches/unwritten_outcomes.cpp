#include "server/gateway/rig/watches/unwritten_outcomes.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include "server/base/status.h"

namespace touchstone::gateway {
namespace {

// Whether the journal refused the step itself, so that trying again cannot help: everything else is a disk that is full or
// fails, or another program's lock.
bool IsWrong(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status) ||
         absl::IsAlreadyExists(status);
}

absl::Status Waiting(absl::string_view id, bool made, absl::string_view why) {
  return absl::ResourceExhaustedError(
      absl::StrCat("touch '", id, "' ", made ? "was made, but its result" : "failed, but that",
                   " could not be written down: ", why,
                   ". It is kept while this gateway runs: make room, then ask "
                   "again under the same id",
                   made ? "; it is not made again" : ""));
}

}  // namespace

UnwrittenOutcomes::~UnwrittenOutcomes() {
  Flush();
  for (const Outcome& outcome : outcomes_)
    spdlog::error(
        "journal: what became of touch '{}' of session '{}' could not be written; it is reconciled at the "
        "next start",
        outcome.id, outcome.session);
  for (const auto& [key, value] : facts_)
    spdlog::error("journal: '{}' = '{}' could not be written", key, value);
}

absl::Status UnwrittenOutcomes::Write(const Outcome& outcome) {
  if (!outcome.result.has_value()) return journal_->Failed(outcome.session, outcome.id, outcome.error);
  return journal_->Done(outcome.session, outcome.id, *outcome.result,
                        outcome.series.has_value() ? &*outcome.series : nullptr);
}

absl::Status UnwrittenOutcomes::WriteOrKeep(Outcome outcome) {
  const std::lock_guard<std::mutex> lock(mutex_);
  absl::Status written = WriteFacts({});
  if (written.ok()) written = Write(outcome);
  if (written.ok() || IsWrong(written)) return written;
  spdlog::error("journal: {}", std::string(written.message()));
  const absl::Status waiting = Waiting(outcome.id, outcome.result.has_value(), written.message());
  outcomes_.push_back(std::move(outcome));
  return waiting;
}

absl::Status UnwrittenOutcomes::Done(const std::string& session, const std::string& id,
                                     const session::JournalResult& result,
                                     const session::JournalSeries* series) {
  Outcome outcome{session, id, result, std::nullopt, ""};
  if (series != nullptr) outcome.series = *series;
  return WriteOrKeep(std::move(outcome));
}

absl::Status UnwrittenOutcomes::Failed(const std::string& session, const std::string& id,
                                       const std::string& error) {
  return WriteOrKeep({session, id, std::nullopt, std::nullopt, error});
}

absl::Status UnwrittenOutcomes::SetFacts(const Facts& facts, bool keep) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const absl::Status written = WriteFacts(facts);
  if (!written.ok() && keep)
    for (const auto& [key, value] : facts) facts_[key] = value;
  return written;
}

absl::Status UnwrittenOutcomes::WriteFacts(const Facts& facts) {
  std::map<std::string, std::string> all = facts_;
  for (const auto& [key, value] : facts) all[key] = value;
  if (all.empty()) return absl::OkStatus();
  const absl::Status written = journal_->SetMetadata(Facts(all.begin(), all.end()));
  if (written.ok()) facts_.clear();
  return written;
}

void UnwrittenOutcomes::Flush() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!WriteFacts({}).ok()) return;
  for (auto outcome = outcomes_.begin(); outcome != outcomes_.end();) {
    const absl::Status written = Write(*outcome);
    const bool stays = !written.ok() && !IsWrong(written);
    if (!written.ok() && !stays) spdlog::error("journal: {}", std::string(written.message()));
    outcome = stays ? std::next(outcome) : outcomes_.erase(outcome);
  }
}

absl::Status UnwrittenOutcomes::Kept(const std::string& session, const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Outcome& outcome : outcomes_)
    if (outcome.session == session && outcome.id == id)
      return Waiting(id, outcome.result.has_value(), "the journal's disk is still full");
  return absl::OkStatus();
}

}  // namespace touchstone::gateway
