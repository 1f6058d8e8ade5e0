// One connection to the emulated controller, by the port that it came to.
#pragma once

#include <limits>
#include <memory>
#include <string>

#include "tests/rig/controller/network/net.h"
#include "tests/rig/controller/network/unread.h"
#include "tests/rig/controller/protocol/rtde_session.h"
#include "tests/rig/controller/script/program_reader.h"

namespace touchstone::rig {

// UR's numbers: 29999, 30001, 30002, 30003, 30004, 30011, 30012, 30013.
enum Port {
  kDashboard,
  kPrimary,
  kSecondary,
  kRealtime,
  kRtde,
  kPrimaryReadOnly,
  kSecondaryReadOnly,
  kRealtimeReadOnly,
  kPorts
};

struct Client {
  Client(Port the_port, int fd, bool is_local) : port(the_port), connection(fd), local(is_local) {}

  // UR's guide to the primary and secondary interfaces: both get states and the version, only the primary messages.
  bool GetsStates() const { return port == kSecondary || port == kSecondaryReadOnly || GetsMessages(); }
  bool GetsMessages() const { return port == kPrimary || port == kPrimaryReadOnly; }
  bool SendsPrograms() const { return port == kPrimary || port == kSecondary || port == kRealtime; }
  bool realtime() const { return port == kRealtime || port == kRealtimeReadOnly; }
  // Wants a package of data every so many seconds of host time; infinite: none.
  double DataPeriodS(double cycle_s) const {
    if (realtime()) return cycle_s;
    return rtde && rtde->started() ? 1 / rtde->rate_hz() : std::numeric_limits<double>::infinity();
  }
  bool WantsData() const { return realtime() || (rtde && rtde->started()); }
  // Data were sent to it that it has not read yet.
  bool HasToRead() { return WantsData() && patience.WaitsFor(UnreadByPeer(connection.fd())); }

  Port port;
  QueuedConnection connection;
  bool local;  // it came while the robot was in local control
  std::string received;
  ProgramReader programs;
  std::unique_ptr<RtdeSession> rtde;
  ReaderPatience patience;
  double next_data_s = 0;    // simulated time at which the next package is due
  double data_cycle_s = -1;  // that of the last one
};

}  // namespace touchstone::rig
