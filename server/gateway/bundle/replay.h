// A bug report to be served again: the session as a journal, what failed and was refused in its course, and what the gateway
// said of its rig.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/gateway/bundle/bundle_file.h"
#include "server/source/object_store.h"
#include "server/source/recorded_rig.h"
#include "touchstone/v1/control.pb.h"
#include "touchstone/v1/rig.pb.h"

namespace touchstone::gateway::bundle {

struct Replay {
  std::string name;                      // the bundle's file, without its folder
  std::unique_ptr<OpenedBundle> bundle;  // its files stay as long as this does
  std::string journal;                   // path of the session's
  source::RecordedFaults faults;
  std::vector<source::MeshSpec> meshes;
  // As it was when the bundle was made; without that, what the session says. Every origin in it says that it is a replay.
  v1::RigState rig;
  v1::State state;
  bool has_state = false;
};

absl::StatusOr<Replay> OpenReplay(const std::string& path);

}  // namespace touchstone::gateway::bundle
