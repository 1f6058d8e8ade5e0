// One clock told in terms of another, over a line that delays: offset, rate, and how well they are known.
#pragma once

#include <cstdint>
#include <vector>

namespace touchstone {

// remote_s = remote_at_s + rate * (host_s - host_at_s).
struct ClockEstimate {
  bool valid = false;
  double host_at_s = 0;
  double remote_at_s = 0;
  double rate = 1;                // remote seconds in one host second
  double offset_uncertainty_s = 0;  // standard, in remote seconds, at host_at_s
  double rate_uncertainty = 0;      // standard
  uint64_t round_trips = 0;
  double shortest_round_trip_s = 0;

  double RemoteOf(double host_s) const { return remote_at_s + rate * (host_s - host_at_s); }
  double HostOf(double remote_s) const { return host_at_s + (remote_s - remote_at_s) / rate; }
};

// Not thread-safe. Delays are at least some unknown minimum and often more; what is early is believed, what is late is
// not. Steps of the remote clock (a reset) start it anew.
class ClockSync {
 public:
  // nominal_rate: remote seconds in one host second, about (1; the time scale of an accelerated emulator).
  explicit ClockSync(double nominal_rate = 1);

  // A query that left at host_send_s, was received and answered at these remote times, and came back.
  void AddRoundTrip(double host_send_s, double remote_receive_s, double remote_send_s, double host_receive_s);
  // A message stamped remote_s that arrived at host_receive_s: bounds the offset from one side only; the shortest delay
  // itself stays unknown and is taken as `assumed_delay_s` with as large an uncertainty.
  void AddOneWay(double remote_s, double host_receive_s, double assumed_delay_s);

  ClockEstimate Estimate() const;
  void Reset();

 private:
  struct Bound {
    double host_s, remote_s;
  };
  double nominal_rate_;
  std::vector<Bound> lower_, upper_;  // of remote on host; the implementer changes what is private as needed
  uint64_t round_trips_ = 0;
};

}  // namespace touchstone
