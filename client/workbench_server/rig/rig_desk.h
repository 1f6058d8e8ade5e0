// The rig behind the page's view Touch: which page controls it, its lease, its dry runs and its runs, and what every page sees
// of them. One page controls, the others look on; every page may stop the rig. Nothing moves without an act of the page that
// controls, which says that a person has agreed ("confirmed": true). Where that page goes, the lease is given back as soon as the
// rig is at rest: what it has begun ends first, but for a wait for a person, which ends the run.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "client/source/connection/leased_source.h"
#include "client/workbench_server/http/watchers.h"
#include "client/workbench_server/pages.h"
#include "client/workbench_server/rig/touch_run.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::workbench {

// All functions but Open may be called from any thread.
class RigDesk {
 public:
  // `rig` is connected to a physical source; FAILED_PRECONDITION where it is another one. `log` gets a line each for people.
  static absl::StatusOr<std::unique_ptr<RigDesk>> Open(std::unique_ptr<client::Connection> rig,
                                                       std::function<void(const std::string&)> log);
  // Stops what moves, and gives the lease back.
  ~RigDesk();

  // One act of a page, JSON {"page": ID, "act": NAME, ...}, ID of 1 to 64 letters, digits and dashes. OK: it is done or begun;
  // what becomes of it is seen by Watch. FAILED_PRECONDITION: not this page, or not now.
  //   hello (hidden, begins)                 is there; said every two seconds, and where its tab comes into sight or goes
  //   bye                                    is closed, or loaded again
  //   acquire, take_lease                    control and the rig's lease; take_lease: from whoever holds it, unless the rig is moving
  //   request, decline, give (to), release   control between pages; never while a run or a motion is under way
  //   take                                   control from another page; not while something moves
  //   check (plan)                           a dry run, touch_run.h
  //   start (check, confirmed, skip_impossible), mounted (ask, confirmed), power_on (confirmed), home (confirmed), reset (reason)
  absl::Status Act(const std::string& request);
  // Stops the rig, for any page, whatever else is under way: {"press": ID, "reason": TEXT}; a press that comes twice is one stop.
  // JSON {"aborted_touches", "standstill", "not_confirmed"}; UNAVAILABLE where the stop did not reach the gateway.
  absl::StatusOr<std::string> Stop(const std::string& request);
  // {"rig", "desk", "job", "checked", "last"}, with the touches of the run as its list.
  void Watch(std::shared_ptr<Exchange> exchange);
  // What the run's session has measured so far, as the gateway's journal has it, with a model that has no effect.
  absl::StatusOr<v1::Evidence> Evidence();
  absl::StatusOr<std::string> SetCsv();
  // Of the last dry run, {"check", and what DrawTouches has}.
  absl::StatusOr<std::string> Drawing() const;
  const std::string& address() const { return address_; }

 private:
  using Json = nlohmann::json;
  struct Job {
    std::string name;
    bool moves = false;
    std::function<absl::Status()> run;
  };
  RigDesk(std::unique_ptr<client::Connection> rig, ObjectsOfSource objects,
          std::function<void(const std::string&)> log);

  absl::Status ActLocked(const std::string& page, const std::string& act, const Json& request);
  absl::Status Between(const std::string& page, const std::string& act, const Json& request);
  absl::Status CheckControls(const std::string& page) const;
  absl::Status CheckConfirmed(const Json& request) const;
  absl::Status BeginJob(std::string name, bool moves, std::function<absl::Status()> run);
  bool ControllerWent() const;
  void GiveUpControlOfGonePage();  // with the lock

  // On the worker's thread, without the lock.
  absl::Status Acquire(const std::string& page, bool take);
  absl::Status RunTouches(bool skip_impossible);
  absl::Status AskPerson(const std::string& words);
  absl::Status Reset(const std::string& reason, const std::string& page);
  absl::Status Drop();

  void Work();
  void Look();
  Json LookAtRig();
  std::string StateText() const;  // with the lock
  void Changed();                 // without the lock

  const std::unique_ptr<client::Connection> rig_;  // the worker's
  const std::string address_;
  const ObjectsOfSource objects_;
  const std::function<void(const std::string&)> log_;
  // Of the connection as it was opened, which finds the same address again by itself; safe from every thread.
  const std::unique_ptr<v1::Control::Stub> control_;
  const std::unique_ptr<v1::Rig::Stub> state_;
  const std::unique_ptr<v1::Sessions::Stub> sessions_;
  const std::shared_ptr<Watchers> watchers_ = std::make_shared<Watchers>();

  std::mutex publishing_;     // states are published in the order in which they were true
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  Pages pages_;
  std::string controller_;
  std::vector<std::string> requests_;
  std::unique_ptr<client::LeasedSource> source_;  // while a page controls; changed by the worker alone
  std::unique_ptr<TouchRun> run_;
  uint64_t check_ = 0, ask_ = 0, beat_ = 0;
  std::string asked_;  // what a person is asked to do; empty: nothing
  size_t done_ = 0;
  Job job_;
  bool stopping_ = false, ending_ = false;
  bool interrupted_ = false;  // source_ makes no more calls
  bool moving_ = false;       // as the gateway said last
  std::string last_error_, last_text_;
  std::string press_;  // of the last stop
  absl::StatusOr<std::string> press_answer_ = std::string();
  Json rig_json_ = Json::object();

  std::thread worker_, looker_;
};

}  // namespace touchstone::workbench
