// What the commands of `touchstone rig` share; one file per command.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/cli/common/common.h"
#include "client/cli/options/motion_options.h"
#include "client/source/plans/rig_plan.h"
#include "client/source/plans/rig_words.h"

namespace touchstone::cli {

using client::CheckRows;
using client::PlannedRow;
using client::RigGroup;

// A connection to --server, which must be given and must be a physical source: its description goes along.
struct RigConnection {
  std::unique_ptr<client::Connection> connection;
  v1::DescribeResponse source;
};
absl::StatusOr<RigConnection> ConnectToRig(const Cli& cli);

absl::StatusOr<v1::RigState> GetRig(client::Connection* connection);
// {"state": State, "rig": RigState}: as JSON with the protocol's names and units.
absl::StatusOr<Json> RigJson(const v1::State& state, const v1::RigState& rig);

// Says that the object lies on the fixture as it must. Where the rig changes it by itself it does; else the arm
// goes home and a person is asked, unless it lies there already.
absl::Status MountForTouches(const Cli& cli, client::LeasedSource* source, const v1::RigState& state,
                             const std::string& object, const std::string& up_face);

// "2 of 192 touches are impossible: ...", with a line for each of the first few.
std::string ImpossibleTable(const std::vector<PlannedRow>& rows, size_t max_lines);

// One file per command.
void AddRigStatus(Cli* cli, CLI::App* group);
void AddRigMotions(Cli* cli, CLI::App* group);  // stop, reset, power-on, home, mount
void AddRigDryRun(Cli* cli, CLI::App* group);
void AddRigRun(Cli* cli, CLI::App* group);
void AddRigPhotos(Cli* cli, CLI::App* group);
void AddRigCalibrate(Cli* cli, CLI::App* group);
void AddRigTeach(Cli* cli, CLI::App* group);
void AddRigBundle(Cli* cli, CLI::App* group);

}  // namespace touchstone::cli
