#include "server/base/units.h"

#include "server/base/check.h"

namespace touchstone {
namespace {

struct UnitRow {
  Unit unit;
  double si_factor;
  absl::string_view symbol;
  absl::string_view suffix;
};

constexpr UnitRow kUnits[] = {
    {Unit::kNone, 1.0, "", ""},
    {Unit::kMillimetre, kMetresPerMillimetre, "mm", "_mm"},
    {Unit::kDegree, kRadiansPerDegree, "deg", "_deg"},
    {Unit::kMicrosecond, kSecondsPerMicrosecond, "us", "_us"},
    {Unit::kSecond, 1.0, "s", "_s"},
    {Unit::kMillimetrePerSecond, kMetresPerMillimetre, "mm/s", "_mm_s"},
    {Unit::kMillimetrePerSecondSquared, kMetresPerMillimetre, "mm/s^2", "_mm_s2"},
    {Unit::kMillimetrePerHour, kMetresPerMillimetre / 3600.0, "mm/h", "_mm_per_h"},
    {Unit::kPerMetre, 1.0, "1/m", "_per_m"},
    {Unit::kPixel, 1.0, "px", "_px"},
    {Unit::kGreyLevel, 1.0, "grey", "_grey"},
};

const UnitRow& Row(Unit unit) {
  for (const UnitRow& row : kUnits)
    if (row.unit == unit) return row;
  TOUCHSTONE_CHECK(false && "every unit has a row");
  return kUnits[0];
}

}  // namespace

double SiFactor(Unit unit) {
  return Row(unit).si_factor;
}
absl::string_view UnitSymbol(Unit unit) {
  return Row(unit).symbol;
}
absl::string_view UnitSuffix(Unit unit) {
  return Row(unit).suffix;
}

bool UnitFromSymbol(absl::string_view symbol, Unit* unit) {
  for (const UnitRow& row : kUnits) {
    if (row.symbol != symbol) continue;
    *unit = row.unit;
    return true;
  }
  return false;
}

}  // namespace touchstone
