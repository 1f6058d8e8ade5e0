#include "server/effects/contact/surface_departure.h"

#include <algorithm>
#include <cmath>

namespace touchstone::effects {

void MoveSurface(const std::function<double(const Eigen::Vector3d& point_in_mesh)>& departure_m,
                 TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    for (int touch = 0; touch < touches.size(); ++touch) {
      const int entry = touches.At(finger, touch);
      if (std::isnan(touches.travel_m[entry])) continue;
      const double earlier_m = departure_m(ContactInMesh(touches, entry)) /
                               std::max(touches.cos_incidence[entry], kMinDepartureCosine);
      touches.travel_m[entry] -= earlier_m;
      touches.contact_m[entry] -= earlier_m * touches.approach[touch];
    }
  }
}

}  // namespace touchstone::effects
