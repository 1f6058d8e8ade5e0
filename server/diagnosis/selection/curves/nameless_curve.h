// Curves without a name: what the residuals follow of one covariate, whatever its shape. A curve is linear between
// knots; its values have a prior that punishes bends (second differences) and absurd sizes, and the evidence,
// averaged over how much it may bend, judges it as it judges effects:
//   r = J theta + B c + (surface) + e,   c ~ N(0, (D'D / bend^2 + I / (knots size^2))^-1)
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/touches/touch_observation_model.h"

namespace touchstone::diagnosis::selection {

// Something that a curve may follow.
struct CurveCovariate {
  std::string name;      // as lookups and formulas name it; "touch" where the set has no session times
  bool differs = false;  // from finger to finger within a touch: a curve that all share can be seen
  bool of_time = false;  // the place in the session
  std::function<double(int k, int finger)> value;
};

// Those that vary. `observations` and `details` (with curvature) must outlive the list.
std::vector<CurveCovariate> ListCurveCovariates(const touches::Observations& observations,
                                                const touches::Prediction& details);

struct NamelessCurve {
  std::string covariate;
  bool of_time = false, per_finger = false, adds_time = false;
  std::vector<double> knots;
  std::vector<std::vector<double>> values;  // mm (us if adds_time) at the knots: one list, or one per finger
  double gain_nats = 0;                     // log evidence over the fit without it
  double p = 1;                             // bound on chance, paid for every curve that was tried
  double effective_dof = 0;
  // Root mean square of rows, s, fitted without a fifth of the poses (of the session's stretches, for time) and
  // measured there: of the fit alone, and with the curve.
  double heldout_without_s = 0, heldout_with_s = 0;
  double any_gain_nats =
      0;  // the same as gain_nats of any curve over this covariate, each as probable as the others
  // The same of a constant and of a straight line in time of one finger, which finger is paid for: what the catalogue's
  // effects say of one finger. Of time only.
  double one_finger_constant_nats = -INFINITY, one_finger_line_nats = -INFINITY;
  std::string
      words;  // what a simple course is: "from touch 480 on finger l travels 0.25 mm farther"; else empty
};

// Curves over `fit`, largest gain first: one per covariate, the better of shared and per finger. Held-out errors are
// those of the best few only. `only`: of this covariate alone; empty: of all.
std::vector<NamelessCurve> ScoreCurves(const engine::Experiment& experiment,
                                       const touches::TouchObservationModel& touches, const engine::Fit& fit,
                                       const touches::Prediction& details, const std::string& only);

// Whether chance hardly brings the curve about, and touches that it was not fitted to have less error with it.
bool IsSignificant(const NamelessCurve& curve);

}  // namespace touchstone::diagnosis::selection
