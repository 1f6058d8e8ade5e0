#include "server/geometry/files/plausible_size.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

// In hand spans: 15 mm, 150 mm and 3 m for three fingers of 30 mm.
constexpr double kSmallest = 0.25, kTypical = 2.5, kLargest = 50;

bool IsPlausible(double side_m, double hand_span_m) {
  return side_m >= kSmallest * hand_span_m && side_m <= kLargest * hand_span_m;
}

std::string Millimetres(double metres) {
  const double mm = FromSi(Unit::kMillimetre, metres);
  const double digit = std::pow(10, std::floor(std::log10(mm)) - 2);
  return ShortestNumber(mm > 1e-6 && mm < 1e9 ? std::stod(absl::StrCat(std::round(mm / digit) * digit)) : mm);
}

}  // namespace

std::string SizeNote(const Bounds& bounds, double hand_span_m, const std::string& unit) {
  const double side_m = (bounds.max_m - bounds.min_m).maxCoeff();
  if (!(side_m > 0) || IsPlausible(side_m, hand_span_m)) return "";
  // The other unit that brings the object nearest to what a hand like this touches; else a power of ten.
  const auto distance = [&](double factor) {
    return std::abs(std::log(side_m * factor / (kTypical * hand_span_m)));
  };
  const double present_m = *MetresPerMeshUnit(unit);
  std::string fix;
  double best_factor = 0;
  for (const std::string& other : MeshUnitNames()) {
    const double factor = *MetresPerMeshUnit(other) / present_m;
    if (!IsPlausible(side_m * factor, hand_span_m)) continue;
    if (best_factor != 0 && distance(factor) >= distance(best_factor)) continue;
    best_factor = factor;
    fix = absl::StrCat("unit ", other, " instead of ", unit);
  }
  if (best_factor == 0) {
    best_factor = std::pow(10, std::round(std::log10(kTypical * hand_span_m / side_m)));
    fix = absl::StrCat("scale ", ShortestNumber(best_factor));
  }
  return absl::StrCat("its longest side is ", Millimetres(side_m), " mm, implausibly ",
                      side_m > hand_span_m ? "large" : "small", " for fingers that span ",
                      Millimetres(hand_span_m), " mm. Was the mesh read in the wrong unit? With ", fix,
                      " it would be ", Millimetres(side_m * best_factor), " mm");
}

}  // namespace touchstone::geometry
