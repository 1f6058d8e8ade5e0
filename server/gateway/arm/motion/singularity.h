// How near a motion comes to where a UR arm loses a degree of freedom: there its joints have to turn fast for little
// motion of the tip, and the controller may stop it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/gateway/arm/kinematics/arm_body.h"
#include "server/gateway/arm/kinematics/kinematics.h"

namespace touchstone::gateway::arm {

// Universal Robots' three. Nearness: of the wrist, how far wrist 2 is from 0 or 180 deg, where the axes of wrist 1 and
// wrist 3 are parallel; of the elbow, how far it is from stretched; of the shoulder, how far wrist 3 is from the cylinder
// round the base's axis that it cannot enter.
class SingularityWatch {
 public:
  void Look(const UrKinematics& kinematics, const BodyPoints& points, const Joints& joints,
            const Eigen::Vector3d& tip_m, const std::string& what);
  // A sentence for each that came near: within 10 deg (wrist, elbow) or 30 mm (shoulder).
  std::vector<std::string> Notes() const;

 private:
  struct Nearest {
    double distance = 1e300;  // rad or m
    Eigen::Vector3d tip_m;
    std::string what;
  };
  void Keep(Nearest* nearest, double distance, const Eigen::Vector3d& tip_m, const std::string& what);
  Nearest wrist_, elbow_, shoulder_;
};

}  // namespace touchstone::gateway::arm
