#include "server/diagnosis/checks/object_mistakes.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/checks/tried.h"

namespace touchstone::diagnosis::checks {
namespace {

using Offsets = std::vector<std::pair<std::string, Eigen::Vector3d>>;

double ErrorOf(const TrialResult& result, const std::string& object) {
  const auto found = result.objects.find(object);
  return found == result.objects.end() ? INFINITY : std::sqrt(found->second.error_s2);
}

bool Explains(const TrialResult& before, const TrialResult& after, const std::string& object) {
  const auto found = after.objects.find(object);
  return found != after.objects.end() && found->second.touches >= kCheckRules.min_touches_of_object &&
         after.Relative({object}) <= kCheckRules.max_left &&
         after.Relative({object}) <=
             kCheckRules.max_ratio * std::min(before.Relative({object}), kCheckRules.max_before.value());
}

// Physics that is missing biases a fitted offset by some tenths of a millimetre, and whoever mounts an object too low
// does so by a round length: whole millimetres where they are near.
double Rounded(double offset_m) {
  const auto to_multiple = [offset_m](double step_m) { return std::round(offset_m / step_m) * step_m; };
  const double whole_m = to_multiple(kMetresPerMillimetre);
  return std::abs(offset_m - whole_m) < kCheckRules.near_whole_m ? whole_m
                                                                 : to_multiple(kCheckRules.finest_offset_m);
}

// The offset along z of each object that leaves least, coarse to fine, all objects at once.
std::vector<double> BestOffsets(const Trial& trial) {
  const std::vector<std::string>& objects = trial.input().set->objects;
  std::vector<double> best(objects.size(), 0), error(objects.size(), INFINITY);
  double height_m = 0;
  for (const std::string& object : objects) {
    const geometry::Bounds& bounds = trial.input().surfaces.at(object)->bounds();
    height_m = std::max(height_m, bounds.max_m.z() - bounds.min_m.z());
  }
  const auto look = [&](const std::vector<double>& offset_m) {
    session::MeasurementFix fix;
    for (size_t o = 0; o < objects.size(); ++o)
      fix.move_objects_m.emplace_back(objects[o], Eigen::Vector3d(0, 0, offset_m[o]));
    const absl::StatusOr<TrialResult> result = trial.Run(fix);
    if (!result.ok()) return;
    for (size_t o = 0; o < objects.size(); ++o) {
      const double now = ErrorOf(*result, objects[o]);
      if (now < error[o]) error[o] = now, best[o] = offset_m[o];
    }
  };
  const double step_m = std::max(kCheckRules.offset_step_m.value(), height_m / kCheckRules.max_offset_steps);
  for (double offset_m = 0; offset_m <= height_m; offset_m += step_m)
    for (const double sign : {1.0, -1.0}) look(std::vector<double>(objects.size(), sign * offset_m));
  for (double half_m = step_m / 2; half_m > kCheckRules.finest_offset_m / 2; half_m /= 2) {
    const std::vector<double> centre = best;
    for (const double sign : {1.0, -1.0}) {
      std::vector<double> offset_m = centre;
      for (double& value : offset_m) value += sign * half_m;
      look(offset_m);
    }
  }
  return best;
}

}  // namespace

std::vector<Mistake> MisnamedObjects(const Trial& trial, const TrialResult& before) {
  const std::vector<std::string>& objects = trial.input().set->objects;
  std::vector<std::string> best = objects;
  std::vector<double> least(objects.size());
  for (size_t o = 0; o < objects.size(); ++o) least[o] = kCheckRules.max_ratio * ErrorOf(before, objects[o]);
  for (const auto& [mesh, surface] : trial.input().surfaces) {
    session::MeasurementFix fix;
    for (const std::string& object : objects)
      if (object != mesh) fix.rename_objects.emplace_back(object, mesh);
    const absl::StatusOr<TrialResult> result = trial.Run(fix);
    if (!result.ok()) continue;
    for (size_t o = 0; o < objects.size(); ++o) {
      if (objects[o] == mesh || !(ErrorOf(*result, objects[o]) < least[o])) continue;
      if (!Explains(before, *result, objects[o])) continue;
      least[o] = ErrorOf(*result, objects[o]);
      best[o] = mesh;
    }
  }
  Mistake mistake;
  std::vector<std::string> sentences;
  for (size_t o = 0; o < objects.size(); ++o) {
    if (best[o] == objects[o]) continue;
    mistake.objects.push_back(objects[o]);
    mistake.fix.rename_objects.emplace_back(objects[o], best[o]);
    sentences.push_back(absl::StrCat(objects[o], " is ", best[o]));
  }
  if (sentences.empty()) return {};
  std::vector<std::string> from = mistake.objects, to;
  for (const auto& [old_name, name] : mistake.fix.rename_objects) to.push_back(name);
  std::sort(from.begin(), from.end());
  std::sort(to.begin(), to.end());
  mistake.kind = from == to ? ProblemKind::kObjectNames : ProblemKind::kWrongMesh;
  if (from == to && from.size() == 2) {
    mistake.fix.rename_objects = {{from[0], from[1]}, {from[1], from[0]}};
    mistake.detail = absl::StrCat(from[0], " <-> ", from[1]);
    mistake.words = absl::StrCat("the names of the objects ", from[0], " and ", from[1], " are exchanged");
  } else {
    mistake.detail = absl::StrJoin(sentences, ", ");
    mistake.words = absl::StrCat(
        "what the file calls ", absl::StrJoin(mistake.objects, ", "),
        from == to ? " has another's name: " : " has the mesh of another name: ", mistake.detail);
  }
  return {mistake};
}

std::vector<Mistake> OriginsOfBoundingBox(const Trial& trial) {
  static const char* const kPlaces[3][3] = {{"least x", "mid x", "greatest x"},
                                            {"least y", "mid y", "greatest y"},
                                            {"bottom", "mid height", "top"}};
  std::vector<Mistake> mistakes;
  for (int place = 0; place < 27; ++place) {
    const int at[3] = {place % 3, place / 3 % 3, place / 9};
    Mistake mistake{ProblemKind::kObjectOrigin, "", "", {}, {}};
    double largest_m = 0;
    for (const std::string& object : trial.input().set->objects) {
      const geometry::Bounds& bounds = trial.input().surfaces.at(object)->bounds();
      Eigen::Vector3d anchor_m;
      for (int axis = 0; axis < 3; ++axis)
        anchor_m[axis] = bounds.min_m[axis] + at[axis] * 0.5 * (bounds.max_m[axis] - bounds.min_m[axis]);
      largest_m = std::max(largest_m, anchor_m.norm());
      mistake.fix.move_objects_m.emplace_back(object, -anchor_m);
    }
    if (largest_m < kCheckRules.min_offset_m) continue;
    mistake.detail = absl::StrCat(kPlaces[0][at[0]], ", ", kPlaces[1][at[1]], ", ", kPlaces[2][at[2]]);
    mistake.words = absl::StrCat(
        "the targets are told from another origin than the mesh's: from the bounding box's ", mistake.detail);
    mistakes.push_back(std::move(mistake));
  }
  return mistakes;
}

std::vector<Mistake> OffsetOrigins(const Trial& trial, const TrialResult& before) {
  const std::vector<std::string>& objects = trial.input().set->objects;
  const std::vector<double> offset_m = BestOffsets(trial);
  session::MeasurementFix all;
  for (size_t o = 0; o < objects.size(); ++o)
    all.move_objects_m.emplace_back(objects[o], Eigen::Vector3d(0, 0, offset_m[o]));
  const absl::StatusOr<TrialResult> result = trial.Run(all);
  if (!result.ok()) return {};

  Mistake mistake{ProblemKind::kObjectOrigin, "", "", {}, {}, true};
  double sum_m = 0;
  for (size_t o = 0; o < objects.size(); ++o) {
    if (std::abs(offset_m[o]) < kCheckRules.min_offset_m || !Explains(before, *result, objects[o])) continue;
    mistake.objects.push_back(objects[o]);
    mistake.fix.move_objects_m.push_back(all.move_objects_m[o]);
    sum_m += offset_m[o];
  }
  if (mistake.objects.empty()) return {};
  // Objects that moved alike moved by the same: the mean is nearer to it than each alone.
  const double mean_m = Rounded(sum_m / static_cast<double>(mistake.objects.size()));
  bool alike = true;
  for (const auto& [object, moved_m] : mistake.fix.move_objects_m)
    alike &= std::abs(moved_m.z() - mean_m) < kCheckRules.same_offset_m;
  std::vector<std::string> texts;
  for (auto& [object, moved_m] : mistake.fix.move_objects_m) {
    if (alike) moved_m.z() = mean_m;
    moved_m.z() = Rounded(moved_m.z());
    texts.push_back(absl::StrFormat("%s %+.1f mm", object, moved_m.z() * kMillimetresPerMetre));
  }
  const std::string common = absl::StrFormat("%+.1f mm", mean_m * kMillimetresPerMetre);
  const bool every = mistake.objects.size() == objects.size();
  mistake.detail =
      alike && every ? absl::StrCat("z ", common) : absl::StrCat("z: ", absl::StrJoin(texts, ", "));
  mistake.words =
      alike ? absl::StrFormat(
                  "%s stood %.1f mm %s than the file says",
                  every && objects.size() > 1 ? "every object" : absl::StrJoin(mistake.objects, ", "),
                  std::abs(mean_m) * kMillimetresPerMetre, mean_m < 0 ? "lower" : "higher")
            : absl::StrCat("objects stood at another height than the file says (", mistake.detail, ")");
  return {mistake};
}

}  // namespace touchstone::diagnosis::checks
