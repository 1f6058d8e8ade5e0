#include "client/cli/options/touch_options.h"

#include <cmath>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/base/units.h"
#include "server/service/core/convert.h"

namespace touchstone::cli {
namespace {

constexpr char kTouchGroup[] = "Touch";

v1::Vector3 Cross(const v1::Vector3& a, const v1::Vector3& b) {
  v1::Vector3 c;
  c.set_x(a.y() * b.z() - a.z() * b.y());
  c.set_y(a.z() * b.x() - a.x() * b.z());
  c.set_z(a.x() * b.y() - a.y() * b.x());
  return c;
}

double Norm(const v1::Vector3& v) {
  return std::sqrt(v.x() * v.x() + v.y() * v.y() + v.z() * v.z());
}

}  // namespace

void AddTouchOptions(CLI::App* command, const std::string& default_standoff, TouchFlags* options) {
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) {
    command->add_option(name, value, text)->type_name(type)->group(kTouchGroup);
  };
  add("--approach", options->approach, "X,Y,Z",
      "Unit vector along which the fingers move, for instance 0,0,-1");
  add("--target-mm", options->target_mm, "X,Y,Z",
      "Point that the middle finger aims at. Default: the centre of the object's bounding box");
  add("--lateral", options->lateral, "X,Y,Z",
      "Unit vector from the first finger towards the last, perpendicular to the approach. "
      "Default: approach x z, or x for a vertical approach");
  add("--standoff-mm", options->standoff_mm, "MM",
      absl::StrCat("Distance of the start from the target. Default: ", default_standoff));
  add("--speed-mm-s", options->speed_mm_s, "MM/S", "Speed of the approach. Default: 20");
}

absl::StatusOr<v1::CommandedTouch> MakeTouch(const TouchFlags& o) {
  v1::CommandedTouch touch;
  if (o.approach.empty())
    return absl::InvalidArgumentError(
        "--approach is missing: the direction of the touch, for instance 0,0,-1");
  TOUCHSTONE_ASSIGN_OR_RETURN(*touch.mutable_approach(), ParseVector("--approach", o.approach));
  if (!o.target_mm.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(*touch.mutable_target_m(), ParseMillimetres("--target-mm", o.target_mm));
  }
  if (!o.lateral.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(*touch.mutable_lateral(), ParseVector("--lateral", o.lateral));
  } else {
    v1::Vector3 z;
    z.set_z(1);
    v1::Vector3 lateral = Cross(touch.approach(), z);
    const double length = Norm(lateral);
    // A vertical approach has no horizontal "right"; x is as good as any.
    constexpr double kVertical = 1e-9;
    if (length > kVertical) {
      lateral.set_x(lateral.x() / length);
      lateral.set_y(lateral.y() / length);
      lateral.set_z(0);
    } else {
      lateral = v1::Vector3();
      lateral.set_x(1);
    }
    *touch.mutable_lateral() = lateral;
  }
  // In the units that the user typed; the source would answer in its own.
  constexpr double kMaxSpeedMmS = kMaxSpeedMS * kMillimetresPerMetre;
  constexpr double kMaxStandoffMm = kMaxStandoffM * kMillimetresPerMetre;
  if (!(o.speed_mm_s > 0) || o.speed_mm_s > kMaxSpeedMmS)
    return absl::InvalidArgumentError(absl::StrCat("--speed-mm-s: ", ShortestNumber(o.speed_mm_s),
                                                   " is out of range; above 0 and at most ", kMaxSpeedMmS));
  const double standoff_mm = o.standoff_mm.value_or(0);
  if (!(standoff_mm >= 0) || standoff_mm > kMaxStandoffMm)
    return absl::InvalidArgumentError(absl::StrCat("--standoff-mm: ", ShortestNumber(standoff_mm),
                                                   " is out of range; from 0 to ", kMaxStandoffMm));
  touch.set_standoff_m(ToSi(Unit::kMillimetre, standoff_mm));
  touch.set_speed_m_s(ToSi(Unit::kMillimetrePerSecond, o.speed_mm_s));
  return touch;
}

void AimAtObject(const TouchFlags& options, const geometry::Bounds& bounds, const StandoffOf& standoff,
                 v1::CommandedTouch* touch) {
  if (options.target_mm.empty()) *touch->mutable_target_m() = service::ToProto(bounds.Centre());
  if (!options.standoff_mm.has_value())
    touch->set_standoff_m(
        standoff(bounds, service::FromProto(touch->target_m()), service::FromProto(touch->approach())));
}

absl::StatusOr<geometry::Bounds> BoundsOfObject(client::Connection* connection, const std::string& object) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse response,
                              connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  std::vector<std::string> known;
  for (const v1::Object& candidate : response.objects()) {
    if (candidate.name() == object)
      return geometry::Bounds{service::FromProto(candidate.bounds_min_m()),
                              service::FromProto(candidate.bounds_max_m())};
    known.push_back(candidate.name());
  }
  return absl::NotFoundError(absl::StrCat("no object is named '", object, "'", DidYouMean(object, known)));
}

}  // namespace touchstone::cli
