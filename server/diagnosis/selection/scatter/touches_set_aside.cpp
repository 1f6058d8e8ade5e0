#include "server/diagnosis/selection/scatter/touches_set_aside.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <map>

#include "server/diagnosis/selection/scatter/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

using engine::Division;

// Which of `count` values is largest in size; -1: none is finite.
int LargestOf(const double* values, int count) {
  int largest = -1;
  for (int i = 0; i < count; ++i)
    if (std::isfinite(values[i]) && (largest < 0 || std::abs(values[i]) > std::abs(values[largest])))
      largest = i;
  return largest;
}

// The direction nearest to the approach, of six.
int FaceOf(const Eigen::Vector3d& approach) {
  const int axis = LargestOf(approach.data(), 3);
  return 2 * axis + (approach[axis] > 0);
}

}  // namespace

engine::SetAside AssessTouchesSetAside(const touches::Observations& o, const std::vector<double>& residuals,
                                       double rmse_s, double noise_s) {
  std::vector<char> outlier(o.size(), 0), aside;
  for (const int k : touches::LeftOutFor(o, touches::kOutlierReason)) outlier[k] = 1;
  Division objects, rounds,
      faces{{"of touches along +x", "of touches along -x", "of touches along +y", "of touches along -y",
             "of touches along +z", "of touches along -z"},
            {}},
      fingers;
  for (const std::string& object : o.objects) objects.groups.push_back("of " + object);
  for (int i = 0; i < o.fingers; ++i)
    fingers.groups.push_back(absl::StrCat("off most by finger ", model::FingerName(i, o.fingers)));
  const std::vector<int> round_of = touches::RoundsOfTouches(o);
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k] && !outlier[k]) continue;
    const int round = round_of[k];
    aside.push_back(outlier[k]);
    objects.group.push_back(o.object[k]);
    while (static_cast<int>(rounds.groups.size()) <= round)
      rounds.groups.push_back(absl::StrCat("of round ", rounds.groups.size()));
    rounds.group.push_back(round);
    const int face = FaceOf(o.set->approach[o.row[k]]);
    faces.group.push_back(face % 2 == 1 ? face - 1 : face + 1);
    fingers.group.push_back(LargestOf(&residuals[static_cast<size_t>(k) * o.fingers], o.fingers));
  }
  return engine::AssessSetAside(aside, {objects, rounds, faces, fingers}, rmse_s, noise_s, "touches",
                                kScatterRules.slips);
}

}  // namespace touchstone::diagnosis::selection
