#include "server/gateway/arm/kinematics/arm_model.h"

#include <absl/strings/str_cat.h>

#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::gateway::arm {
namespace {

DhTable Table(double d1, double a2, double a3, double d4, double d5, double d6) {
  const double quarter = kPi / 2;
  return {{{0, d1, quarter, 0},
           {a2, 0, 0, 0},
           {a3, 0, 0, 0},
           {0, d4, quarter, 0},
           {0, d5, -quarter, 0},
           {0, d6, 0, 0}}};
}

constexpr std::array<double, 6> kWholeTurns = {2 * kPi, 2 * kPi, 2 * kPi, 2 * kPi, 2 * kPi, 2 * kPi};
constexpr double kSlow = 2 * kPi / 3, kMiddle = kPi, kFast = 2 * kPi;  // 120, 180, 360 deg/s

}  // namespace

// Kinematics: Universal Robots, "DH parameters for calculations of kinematics and dynamics" (universal-robots.com,
// articles, 2022-01-19). Joint ranges and speeds: the arms' user manuals, as ur_description's joint_limits.yaml quotes
// them. Payload, reach, force: the arms' data sheets. An e-Series measures the force at its flange; a CB3 estimates it
// from its joints' currents, to 10 N (a maker's answer, forum.universal-robots.com/t/229), and has no range: its own
// safety limits stop it at 150 N.
const std::vector<ArmModel>& ArmModels() {
  static const std::vector<ArmModel> models = {
      {"ur3",
       false,
       Table(0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
       kWholeTurns,
       {kMiddle, kMiddle, kMiddle, kFast, kFast, kFast},
       3,
       0.5,
       125,
       10,
       150},
      {"ur3e",
       true,
       Table(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
       kWholeTurns,
       {kMiddle, kMiddle, kMiddle, kFast, kFast, kFast},
       3,
       0.5,
       500,
       3.5,
       30},
      {"ur5e",
       true,
       Table(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
       kWholeTurns,
       {kMiddle, kMiddle, kMiddle, kMiddle, kMiddle, kMiddle},
       5,
       0.85,
       500,
       4,
       50},
      {"ur10e",
       true,
       Table(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
       kWholeTurns,
       {kSlow, kSlow, kMiddle, kMiddle, kMiddle, kMiddle},
       12.5,
       1.3,
       500,
       5.5,
       100},
  };
  return models;
}

absl::StatusOr<const ArmModel*> FindArmModel(const std::string& name) {
  std::vector<std::string> known;
  for (const ArmModel& model : ArmModels()) {
    if (model.name == name) return &model;
    known.push_back(model.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("arm model '", name, "' is not known", DidYouMean(name, known)));
}

std::string ArmModelNames() {
  std::string names;
  for (size_t k = 0; k < ArmModels().size(); ++k)
    absl::StrAppend(&names, k == 0 ? "" : k + 1 == ArmModels().size() ? " or " : ", ", ArmModels()[k].name);
  return names;
}

}  // namespace touchstone::gateway::arm
