// Many touches on an emulated rig while things break at random; every result is compared with what the
// emulator did. The emulator's data stand for no measurement.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/physical/physical_test.h"

namespace touchstone {

struct EnduranceOptions {
  uint64_t touches = 300;
  uint64_t seed = 1;
  // At most 130: the gateway allows for a second of the host's between an event and its changes, and the
  // device's 32-bit counter comes round in 268 s of the rig's.
  double speedup = 100;
  double fault_share = 0.1;      // of the attempts that something breaks in
  bool own_process = true;       // the gateway is a process, that may be killed; else it is in this one
  double repeated_share = 0.05;  // of the touches that are asked for once more when they are done
  // A journal that an earlier run has left, which this one goes on with, and where it leaves its own. Empty: none.
  std::string journal;
};

struct EnduranceReport {
  uint64_t before = 0;    // ids with a result that an earlier run had left
  uint64_t done = 0;      // ids with a result
  uint64_t attempts = 0;  // calls that were meant to move
  uint64_t failed = 0;    // of them, without a result
  uint64_t never = 0;     // ids that were given up
  uint64_t wrong = 0;     // results that match no emulated touch of their own
  uint64_t changed = 0;   // ids that were answered differently, or moved again, when asked once more
  uint64_t repeats = 0;   // ids that were asked for once more
  uint64_t made = 0;      // emulated touches in all
  uint64_t lost = 0;  // ids with a result for the client but none in the journal at the end, or another one
  uint64_t doubled = 0;     // ids that stand in the journal more than once, or that nobody asked for
  uint64_t unfinished = 0;  // ids in the journal that are neither done nor given up
  std::map<std::string, uint64_t> faults;    // by name
  std::map<std::string, uint64_t> failures;  // by code and the beginning of the message
  double worst_difference_s = 0;             // of a contact time difference from its truth
  double host_s = 0;
  double gateway_rss_tenth_mb = 0, gateway_rss_end_mb = 0;  // resident, after a tenth and at the end
  double own_rss_tenth_mb = 0, own_rss_end_mb = 0;          // of this process: emulator and client
  std::vector<std::string> remarks;                         // the first few things that are wrong, in words

  bool Sound() const {
    return never == 0 && wrong == 0 && changed == 0 && lost == 0 && doubled == 0 && unfinished == 0 &&
           made <= done + failed;
  }
  std::string Text() const;
};

class Endurance : public PhysicalTest {
 public:
  explicit Endurance(EnduranceOptions options) : options_(options), random_(options.seed) {}
  // `progress` is called now and then with how far it has come.
  EnduranceReport Run(const std::function<void(const EnduranceReport&)>& progress = nullptr);

 private:
  struct Expected {
    std::string id;
    v1::CommandedTouch command;
    std::vector<double> contact_time_s;
  };

  void TestBody() override {}
  void StartServing();
  void NewLease();
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  v1::CommandedTouch Command(uint64_t k);
  void MakeTouch(uint64_t k);
  // One call, in which something breaks.
  Answer Broken(const v1::CommandedTouch& command, const std::string& id);
  // What a person does until the rig is ready again.
  void Recover();
  void CompareWithTruth();
  void CompareWithJournal();
  // The earlier run's journal into the rig's folder, and back at the end.
  void TakeUpJournal();
  void LeaveJournal();
  void Remark(const std::string& text);
  void NoteMemory(double* gateway_mb, double* own_mb) const;

  const EnduranceOptions options_;
  std::mt19937_64 random_;
  std::unique_ptr<KeptLease> lease_;
  EnduranceReport report_;
  std::vector<Expected> pending_;  // since the last comparison
  std::map<std::string, std::vector<double>> answered_s_;
  uint64_t first_ = 0;     // number of the first id that no earlier run has used
  uint64_t compared_ = 0;  // the number of the last emulated touch that was
  double usual_s_ = 0.1;   // host time of a touch
};

}  // namespace touchstone
