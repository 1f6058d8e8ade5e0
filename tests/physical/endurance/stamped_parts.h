// The parts of a rig with a clock at their doors: who was asked what when, and how long it took.
#pragma once

#include <memory>
#include <utility>

#include "server/gateway/arm/arm.h"
#include "server/gateway/effector/effector.h"
#include "server/gateway/timing/change_notifier.h"
#include "server/session/journal/journal.h"

namespace touchstone {

// Host seconds of one touch; 0: not yet.
struct Stamps {
  double program_sent_s = 0;                 // StartTouch returned: its program is on the wire
  double go_sent_s = 0, retract_sent_s = 0;  // BeginApproach, EndApproach returned
  double all_heard_s = 0;                    // all contacts were known
  double disk_s = 0, disk_before_s = 0;      // spent in the journal in all, and before the program went out
  double effector_arm_s = 0, effector_disarm_s = 0;  // waited for the end effector's answers
};

class StampedArm : public gateway::arm::Arm {
 public:
  StampedArm(std::unique_ptr<gateway::arm::Arm> arm, Stamps* stamps)
      : arm_(std::move(arm)), stamps_(stamps) {}
  absl::StatusOr<gateway::arm::ArmState> State() const override { return arm_->State(); }
  std::vector<gateway::arm::ArmState> History(double from_s, double to_s) const override {
    return arm_->History(from_s, to_s);
  }
  absl::Status Ready() const override { return arm_->Ready(); }
  absl::Status StartTouch(const gateway::arm::ArmTouch& touch,
                          const gateway::arm::StartGuard& guard) override {
    const absl::Status status = arm_->StartTouch(touch, guard);
    stamps_->program_sent_s = gateway::timing::HostNowS();
    stamps_->disk_before_s = stamps_->disk_s;
    return status;
  }
  absl::Status BeginMotion(uint32_t program_id, const gateway::arm::StartGuard& guard) override {
    return arm_->BeginMotion(program_id, guard);
  }
  absl::Status BeginApproach(uint32_t program_id, const gateway::arm::StartGuard& guard) override {
    const absl::Status status = arm_->BeginApproach(program_id, guard);
    stamps_->go_sent_s = gateway::timing::HostNowS();
    return status;
  }
  absl::Status EndApproach(uint32_t program_id) override {
    const absl::Status status = arm_->EndApproach(program_id);
    stamps_->retract_sent_s = gateway::timing::HostNowS();
    return status;
  }
  absl::Status MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                           const std::vector<std::array<double, 6>>& joints,
                           const gateway::arm::StartGuard& guard) override {
    return arm_->MoveThrough(program_id, poses, joints, guard);
  }
  absl::Status Stop() override { return arm_->Stop(); }
  absl::Status StopOtherwise() override { return arm_->StopOtherwise(); }
  gateway::arm::ForeignPrograms Foreign() const override { return arm_->Foreign(); }
  absl::Status PowerOn(const std::function<absl::Status()>& guard) override { return arm_->PowerOn(guard); }
  void SendHeartbeat() override { arm_->SendHeartbeat(); }
  gateway::timing::ClockEstimate ControllerClock() const override { return arm_->ControllerClock(); }
  double StateRateHz() const override { return arm_->StateRateHz(); }
  std::string Model() const override { return arm_->Model(); }
  std::string Address() const override { return arm_->Address(); }
  std::string Version() const override { return arm_->Version(); }

 private:
  const std::unique_ptr<gateway::arm::Arm> arm_;
  Stamps* const stamps_;
};

class StampedEffector : public gateway::effector::Effector {
 public:
  StampedEffector(std::unique_ptr<gateway::effector::Effector> effector, int fingers, Stamps* stamps)
      : effector_(std::move(effector)), fingers_(fingers), stamps_(stamps) {}
  absl::Status StartCapture(uint32_t touch, const std::function<absl::Status()>& guard) override {
    const double began_s = gateway::timing::HostNowS();
    const absl::Status status = effector_->StartCapture(touch, guard);
    stamps_->effector_arm_s = gateway::timing::HostNowS() - began_s;
    return status;
  }
  absl::Status EndCapture() override {
    const double began_s = gateway::timing::HostNowS();
    const absl::Status status = effector_->EndCapture();
    stamps_->effector_disarm_s = gateway::timing::HostNowS() - began_s;
    return status;
  }
  absl::StatusOr<gateway::effector::EffectorTouch> Touch() const override {
    const double now_s = gateway::timing::HostNowS();
    absl::StatusOr<gateway::effector::EffectorTouch> touch = effector_->Touch();
    if (touch.ok() && stamps_->all_heard_s == 0 && touch->Contacts() == fingers_)
      stamps_->all_heard_s = now_s;
    return touch;
  }
  absl::StatusOr<gateway::effector::EffectorTouch> Recall(uint32_t touch) override {
    return effector_->Recall(touch);
  }
  gateway::effector::EffectorState State() const override { return effector_->State(); }
  gateway::timing::ClockEstimate Clock() const override { return effector_->Clock(); }

 private:
  const std::unique_ptr<gateway::effector::Effector> effector_;
  const int fingers_;
  Stamps* const stamps_;
};

class StampedJournal : public session::Journal {
 public:
  StampedJournal(std::unique_ptr<session::Journal> journal, Stamps* stamps)
      : journal_(std::move(journal)), stamps_(stamps) {}
  absl::Status EnsureSession(const session::JournalSession& session) override {
    return journal_->EnsureSession(session);
  }
  absl::StatusOr<std::vector<session::JournalSession>> Sessions() const override {
    return journal_->Sessions();
  }
  absl::StatusOr<session::JournalSession> Session(const std::string& name) const override {
    return journal_->Session(name);
  }
  bool has_checksums() const override { return journal_->has_checksums(); }
  absl::StatusOr<bool> HasSession(const std::string& name) const override {
    return journal_->HasSession(name);
  }
  absl::Status SetSessionClock(const std::string& name, const session::JournalClock& clock) override {
    const Timed timed(stamps_);
    return journal_->SetSessionClock(name, clock);
  }
  absl::StatusOr<session::JournalClock> SessionClock(const std::string& name) const override {
    return journal_->SessionClock(name);
  }
  absl::Status DeleteSession(const std::string& name, const std::string& by) override {
    return journal_->DeleteSession(name, by);
  }
  absl::StatusOr<std::vector<session::JournalSession>> DeletedSessions() const override {
    return journal_->DeletedSessions();
  }
  absl::Status RestoreSession(const std::string& name) override { return journal_->RestoreSession(name); }
  absl::Status PurgeSession(const std::string& name) override { return journal_->PurgeSession(name); }
  absl::StatusOr<session::JournalTouch> Begin(const std::string& session, const std::string& id,
                                              const std::string& object, const std::string& up_face,
                                              const std::string& command) override {
    const Timed timed(stamps_);
    return journal_->Begin(session, id, object, up_face, command);
  }
  absl::StatusOr<session::JournalTouch> BeginExecuting(const std::string& session, const std::string& id,
                                                       const std::string& object, const std::string& up_face,
                                                       const std::string& command, uint32_t program_id,
                                                       uint32_t boot_id) override {
    const Timed timed(stamps_);
    return journal_->BeginExecuting(session, id, object, up_face, command, program_id, boot_id);
  }
  absl::Status Executing(const std::string& session, const std::string& id, uint32_t program_id,
                         uint32_t boot_id) override {
    const Timed timed(stamps_);
    return journal_->Executing(session, id, program_id, boot_id);
  }
  absl::Status Done(const std::string& session, const std::string& id, const session::JournalResult& result,
                    const session::JournalSeries* series) override {
    const Timed timed(stamps_);
    return journal_->Done(session, id, result, series);
  }
  absl::Status Failed(const std::string& session, const std::string& id, const std::string& error) override {
    return journal_->Failed(session, id, error);
  }
  absl::Status AddSession(const session::SessionContent& content) override {
    return journal_->AddSession(content);
  }
  absl::Status AddFinished(const std::string& session, const std::vector<session::JournalTouch>& touches,
                           const std::vector<std::optional<session::JournalSeries>>& series) override {
    return journal_->AddFinished(session, touches, series);
  }
  absl::StatusOr<std::optional<session::JournalTouch>> Find(const std::string& session,
                                                            const std::string& id) const override {
    return journal_->Find(session, id);
  }
  absl::StatusOr<std::optional<session::JournalSeries>> Series(const std::string& session,
                                                               const std::string& id) const override {
    return journal_->Series(session, id);
  }
  absl::StatusOr<std::optional<session::JournalTouch>> LastDone(const std::string& session) const override {
    return journal_->LastDone(session);
  }
  absl::Status ForEachTouch(const std::string& session,
                            const std::function<bool(const session::JournalTouch&)>& each) const override {
    return journal_->ForEachTouch(session, each);
  }
  absl::StatusOr<std::vector<std::pair<std::string, session::JournalTouch>>> Unfinished() const override {
    return journal_->Unfinished();
  }
  absl::Status AddImage(const std::string& session, const session::JournalImage& image) override {
    return journal_->AddImage(session, image);
  }
  absl::Status ForEachImage(const std::string& session,
                            const std::function<bool(const session::JournalImage&)>& each) const override {
    return journal_->ForEachImage(session, each);
  }
  absl::Status CopySession(const std::string& name, session::Journal* to) const override {
    return journal_->CopySession(name, to);
  }
  absl::Status SetMetadata(const std::vector<std::pair<std::string, std::string>>& values) override {
    const Timed timed(stamps_);
    return journal_->SetMetadata(values);
  }
  absl::StatusOr<std::string> Metadata(const std::string& key) const override {
    return journal_->Metadata(key);
  }

 private:
  struct Timed {
    explicit Timed(Stamps* stamps) : stamps(stamps), began_s(gateway::timing::HostNowS()) {}
    ~Timed() { stamps->disk_s += gateway::timing::HostNowS() - began_s; }
    Stamps* const stamps;
    const double began_s;
  };
  const std::unique_ptr<session::Journal> journal_;
  Stamps* const stamps_;
};

}  // namespace touchstone
