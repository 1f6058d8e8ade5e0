// Estimates one clock from another over a line with delays: offset, rate, and their uncertainties.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace touchstone::gateway::timing {

// remote_s = remote_at_s + rate * (host_s - host_at_s).
struct ClockEstimate {
  bool valid = false;
  double host_at_s = 0;
  double remote_at_s = 0;
  double rate = 1;                  // remote seconds in one host second
  double offset_uncertainty_s = 0;  // standard, in remote seconds, at host_at_s
  double rate_uncertainty = 0;      // standard
  uint64_t round_trips = 0;
  double shortest_round_trip_s = 0;

  double RemoteOf(double host_s) const { return remote_at_s + rate * (host_s - host_at_s); }
  double HostOf(double remote_s) const { return host_at_s + (remote_s - remote_at_s) / rate; }
};

// Not thread-safe. Every message bounds the remote clock: a query shows that it was not later than its
// receipt when the query left, an answer that it was not earlier than its sending when the answer came. The
// estimate is the line midway between the envelopes of both kinds of bounds, so that only the least delays
// count, however long the others are.
//
// What cannot be seen is which part of the shortest round trip each way takes. Halves are assumed, and a
// tenth of the shortest round trip is part of the uncertainty.
//
// Bounds are kept for four minutes of host time and loosen with age as a clock may drift (1.2 ppm a minute
// of host time). What contradicts the estimate is put aside; four contradictions in succession that agree (a
// reset, a step) start it anew.
class ClockSync {
 public:
  // nominal_rate: remote seconds in one host second, right within 1000 ppm (1; the time scale of
  // an accelerated emulator).
  explicit ClockSync(double nominal_rate = 1);

  // A query that left at host_send_s, was received and answered at these remote times, and came back. Ignored
  // if the answer came before the query left or anything is not finite.
  void AddRoundTrip(double host_send_s, double remote_receive_s, double remote_send_s, double host_receive_s);
  // A message stamped remote_s that arrived at host_receive_s: bounds the offset from one side only; the
  // shortest delay itself stays unknown and is taken as `assumed_delay_s` (host seconds) with as large an
  // uncertainty. Not used while there are round trips.
  void AddOneWay(double remote_s, double host_receive_s, double assumed_delay_s);

  // At the newest message. Computed when asked for and kept until there is news, so that asking costs little.
  ClockEstimate Estimate() const;
  void Reset();

 private:
  // Of the remote clock's lead over the host's, in host seconds, since the first message: ahead = remote /
  // nominal - host.
  struct Bound {
    double host_s, ahead_s;
  };
  // One message: bounds from above and below; a message of one way has none from above.
  struct Message {
    double host_send_s, remote_receive_s, remote_send_s, host_receive_s;
    bool one_way;
  };
  struct Side;

  void Add(const Message& message);
  void Take(const Message& message);
  bool Contradicts(const Message& message) const;
  void Insert(std::deque<Bound>& bounds, Bound bound, double sign);
  double Ahead(double remote_s, double host_s) const;
  Side Prepare(const std::deque<Bound>& bounds, double from_host_s, double sign) const;
  bool Fit(double window_s, ClockEstimate* estimate) const;

  double nominal_rate_;
  bool begun_ = false;
  double base_host_s_ = 0, base_remote_s_ = 0;  // of the first message, so that small numbers stay precise
  double newest_host_s_ = 0;                    // since base
  double assumed_delay_s_ = 0;
  std::deque<Bound> upper_, lower_, one_way_;  // in the order of host_s
  std::vector<Message> aside_;                 // contradictions in succession
  uint64_t round_trips_ = 0;
  double shortest_round_trip_s_ = 0;
  mutable bool stale_ = true;
  mutable double estimated_at_s_ = 0;
  mutable ClockEstimate estimate_;
};

}  // namespace touchstone::gateway::timing
