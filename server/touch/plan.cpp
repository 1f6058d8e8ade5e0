#include "server/touch/plan.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <map>

#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::touch {
namespace {

// A plan that asks for less has next to no touch.
constexpr double kMinIncidenceRad = 0.1 * kRadiansPerDegree;
// A right angle, however it was rounded.
constexpr double kMaxIncidenceRad = kPi / 2 + 1e-9;

// A word of random bits to 0 .. bound - 1.
uint64_t Below(uint64_t word, uint64_t bound) {
  return static_cast<uint64_t>((static_cast<unsigned __int128>(word) * bound) >> 64);
}

// Cosines and sines of the multiples of a step, from `first` steps on; side by side, because fine steps make
// tables that no longer fit into the second-level cache.
class AngleTable {
 public:
  struct Entry {
    double cosine, sine;
  };
  AngleTable(int64_t first, int64_t count, double step_rad) {
    for (int64_t k = first; k < first + count; ++k)
      entries_.push_back({std::cos(k * step_rad), std::sin(k * step_rad)});
  }
  uint64_t size() const { return entries_.size(); }
  const Entry& operator[](uint64_t k) const { return entries_[k]; }
  void Prefetch(uint64_t k) const { __builtin_prefetch(&entries_[k]); }

 private:
  std::vector<Entry> entries_;
};

// Of one plan, whatever the object: generators share them.
struct SphereTables {
  explicit SphereTables(const SpherePlan& plan)
      : quarter_steps(std::max<int64_t>(1, std::llround(kPi / 2 / plan.step_angle_rad))),
        roll_steps(plan.roll_step_rad > 0 ? std::max<int64_t>(1, std::llround(2 * kPi / plan.roll_step_rad))
                                          : 1),
        theta(0, 4 * quarter_steps, kPi / 2 / quarter_steps),
        phi(-quarter_steps, 2 * quarter_steps + 1, kPi / 2 / quarter_steps),
        roll(0, roll_steps, 2 * kPi / roll_steps) {}

  const int64_t quarter_steps, roll_steps;
  const AngleTable theta, phi, roll;
};

class SphereGenerator : public PoseGenerator {
 public:
  SphereGenerator(const SpherePlan& plan, std::shared_ptr<const SphereTables> tables,
                  const geometry::Bounds& bounds, uint64_t seed)
      : seed_(seed),
        centre_m_(bounds.Centre()),
        radius_m_(plan.radius_ratio * 0.5 * bounds.DiagonalM()),
        tables_(std::move(tables)),
        roll_steps_(tables_->roll_steps),
        theta_(tables_->theta),
        phi_(tables_->phi),
        roll_(tables_->roll) {}

  void Draw(absl::Span<const uint64_t> numbers, uint32_t attempt, TouchPose* poses) const override {
    // All random numbers of a tile come first, so that its look-ups are on their way together.
    constexpr size_t kTile = 64;
    struct Angles {
      uint64_t theta, phi, roll;
    } angles[kTile];
    for (size_t begin = 0; begin < numbers.size(); begin += kTile) {
      const size_t count = std::min(kTile, numbers.size() - begin);
      for (size_t k = 0; k < count; ++k) {
        const auto words = RandomBlock(seed_, RandomDomain::kPose, numbers[begin + k], attempt, 0);
        angles[k] = {Below(words[0], theta_.size()), Below(words[1], phi_.size()),
                     Below(words[2], roll_steps_)};
        theta_.Prefetch(angles[k].theta);
        phi_.Prefetch(angles[k].phi);
      }
      for (size_t k = 0; k < count; ++k)
        SetPose(theta_[angles[k].theta], phi_[angles[k].phi], roll_[angles[k].roll], &poses[begin + k]);
    }
  }
  uint64_t Count() const override { return 0; }
  bool CanRedraw() const override { return true; }

 private:
  void SetPose(const AngleTable::Entry& theta, const AngleTable::Entry& phi, const AngleTable::Entry& roll,
               TouchPose* pose) const {
    pose->target_m = centre_m_;
    pose->standoff_m = radius_m_;
    pose->approach = Eigen::Vector3d(-phi.cosine * theta.cosine, -phi.cosine * theta.sine, -phi.sine);
    pose->lateral = Eigen::Vector3d(-theta.sine, theta.cosine, 0);
    if (roll_steps_ == 1) return;
    const Eigen::Vector3d perpendicular = pose->approach.cross(pose->lateral);
    pose->lateral = roll.cosine * pose->lateral + roll.sine * perpendicular;
  }

  const uint64_t seed_;
  const Eigen::Vector3d centre_m_;
  const double radius_m_;
  const std::shared_ptr<const SphereTables> tables_;
  const int64_t roll_steps_;
  const AngleTable &theta_, &phi_, &roll_;
};

class FacesGenerator : public PoseGenerator {
 public:
  // `surface` null: targets stay on the faces of the box.
  FacesGenerator(const FacesPlan& plan, const geometry::Bounds& bounds, const geometry::Surface* surface,
                 uint64_t seed)
      : plan_(plan), bounds_(bounds), surface_(surface), seed_(seed) {}

  void Draw(absl::Span<const uint64_t> numbers, uint32_t attempt, TouchPose* poses) const override {
    const uint64_t poses_a_round = 6ull * plan_.samples_per_face;
    for (size_t k = 0; k < numbers.size(); ++k) {
      const uint64_t number = numbers[k] % poses_a_round;
      const int face = static_cast<int>(number / plan_.samples_per_face);
      RandomStream random(seed_, RandomDomain::kPose, number, attempt);
      const int axis = face / 2;
      const double side = face % 2 == 0 ? 1 : -1;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;

      // The target on the face of the box.
      Eigen::Vector3d target = bounds_.Centre();
      const Eigen::Vector3d half = 0.5 * (bounds_.max_m - bounds_.min_m);
      target[axis] += side * half[axis];
      target[u] += plan_.spread * half[u] * random.Uniform(-1, 1);
      target[v] += plan_.spread * half[v] * random.Uniform(-1, 1);

      // The approach within a cone around the inward normal (uniform over its solid angle), any roll.
      const double cos_tilt = random.Uniform(std::cos(plan_.max_tilt_rad), 1);
      const double sin_tilt = std::sqrt(std::max(0.0, 1 - cos_tilt * cos_tilt));
      const double around = random.Uniform(0, 2 * kPi), roll = random.Uniform(0, 2 * kPi);
      Eigen::Vector3d inward = Eigen::Vector3d::Zero(), e1 = Eigen::Vector3d::Zero();
      inward[axis] = -side;
      e1[u] = 1;
      const Eigen::Vector3d e2 = inward.cross(e1);
      const Eigen::Vector3d approach =
          (cos_tilt * inward + sin_tilt * (std::cos(around) * e1 + std::sin(around) * e2)).normalized();
      const Eigen::Vector3d p = (e1 - approach.dot(e1) * approach).normalized();
      poses[k].target_m = target;
      poses[k].approach = approach;
      poses[k].lateral = std::cos(roll) * p + std::sin(roll) * approach.cross(p);
      poses[k].standoff_m = plan_.standoff_m;
      poses[k].meets_surface = true;
    }
    if (surface_ != nullptr) PutTargetsOnSurface(absl::MakeSpan(poses, numbers.size()));
  }
  uint64_t Count() const override { return 6ull * plan_.samples_per_face * plan_.rounds; }
  bool CanRedraw() const override { return true; }

 private:
  // Each to where its line first meets the object from outside of the box.
  void PutTargetsOnSurface(absl::Span<TouchPose> poses) const {
    const double outside_m = 0.1 * bounds_.DiagonalM();
    std::vector<Eigen::Vector3d> origins_m, directions;
    for (const TouchPose& pose : poses) {
      origins_m.push_back(pose.target_m - outside_m * pose.approach);
      directions.push_back(pose.approach);
    }
    geometry::Contacts contacts;
    surface_->CastLines(origins_m, directions, kNoStrokeLimitM, &contacts);
    for (size_t k = 0; k < poses.size(); ++k) {
      poses[k].meets_surface = !std::isnan(contacts.travel_m[k]);
      if (poses[k].meets_surface) poses[k].target_m = origins_m[k] + contacts.travel_m[k] * directions[k];
    }
  }

  const FacesPlan plan_;
  const geometry::Bounds bounds_;
  const geometry::Surface* const surface_;
  const uint64_t seed_;
};

class ListGenerator : public PoseGenerator {
 public:
  explicit ListGenerator(const std::vector<CommandedTouch>& touches) : touches_(touches) {}

  void Draw(absl::Span<const uint64_t> numbers, uint32_t attempt, TouchPose* poses) const override {
    for (size_t k = 0; k < numbers.size(); ++k) poses[k] = touches_[numbers[k] % touches_.size()];
  }
  uint64_t Count() const override { return touches_.size(); }
  bool CanRedraw() const override { return false; }

 private:
  const std::vector<CommandedTouch>& touches_;
};

absl::Status CheckBetween(double value, double lower, double upper, const char* field) {
  if (value >= lower && value <= upper) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("plan.", field, " = ", ShortestNumber(value),
                                                 ": must be from ", ShortestNumber(lower), " to ",
                                                 ShortestNumber(upper)));
}

}  // namespace

absl::Status ValidatePlan(Plan* plan) {
  if (plan->kind == Plan::Kind::kList) {
    if (plan->list.empty())
      return absl::InvalidArgumentError("plan.list.touches is empty: give at least one touch");
    for (size_t k = 0; k < plan->list.size(); ++k)
      TOUCHSTONE_RETURN_IF_ERROR(MakeExact(&plan->list[k], absl::StrCat("plan.list.touches[", k, "]")));
    return absl::OkStatus();
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(plan->speed_m_s, 1e-6, 10, "speed_m_s"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(plan->touch_interval_s, 0, 1e6, "touch_interval_s"));
  if (plan->kind == Plan::Kind::kSphere) {
    const SpherePlan& sphere = plan->sphere;
    TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(sphere.step_angle_rad, 1e-5, kPi / 2, "sphere.step_angle_rad"));
    if (sphere.roll_step_rad != 0)
      TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(sphere.roll_step_rad, 1e-5, 2 * kPi, "sphere.roll_step_rad"));
    TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(sphere.max_incidence_rad, kMinIncidenceRad, kMaxIncidenceRad,
                                            "sphere.max_incidence_rad"));
    return CheckBetween(sphere.radius_ratio, 1, 100, "sphere.radius_ratio");
  }
  const FacesPlan& faces = plan->faces;
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(faces.samples_per_face, 1, 1e6, "faces.samples_per_face"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(faces.rounds, 1, 1e6, "faces.rounds"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(faces.max_tilt_rad, 0, kPi / 3, "faces.max_tilt_rad"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween(faces.spread, 0, 1, "faces.spread"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween(faces.max_incidence_rad, kMinIncidenceRad, kMaxIncidenceRad, "faces.max_incidence_rad"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween(faces.stroke_beyond_target_m, 1e-4, kMaxStandoffM, "faces.stroke_beyond_target_m"));
  return CheckBetween(faces.standoff_m, 1e-6, kMaxStandoffM, "faces.standoff_m");
}

namespace {

// `surface` null: only the box is known.
std::unique_ptr<PoseGenerator> MakeGenerator(const Plan& plan, const geometry::Bounds& bounds,
                                             const geometry::Surface* surface, uint64_t seed) {
  switch (plan.kind) {
    case Plan::Kind::kFaces:
      return std::make_unique<FacesGenerator>(plan.faces, bounds, surface, seed);
    case Plan::Kind::kList:
      return std::make_unique<ListGenerator>(plan.list);
    case Plan::Kind::kSphere:
      break;
  }
  return std::make_unique<SphereGenerator>(plan.sphere, std::make_shared<const SphereTables>(plan.sphere),
                                           bounds, seed);
}

}  // namespace

std::vector<std::shared_ptr<const PoseGenerator>> MakePoseGenerators(
    const Plan& plan, absl::Span<const std::shared_ptr<const geometry::Surface>> surfaces, uint64_t seed) {
  std::shared_ptr<const SphereTables> tables;
  if (plan.kind == Plan::Kind::kSphere) tables = std::make_shared<const SphereTables>(plan.sphere);
  std::map<const geometry::Surface*, std::shared_ptr<const PoseGenerator>> made;
  std::vector<std::shared_ptr<const PoseGenerator>> generators;
  for (const auto& surface : surfaces) {
    std::shared_ptr<const PoseGenerator>& generator = made[surface.get()];
    if (generator == nullptr && tables != nullptr)
      generator = std::make_shared<SphereGenerator>(plan.sphere, tables, surface->bounds(), seed);
    else if (generator == nullptr)
      generator = MakeGenerator(plan, surface->bounds(), surface.get(), seed);
    generators.push_back(generator);
  }
  return generators;
}

std::unique_ptr<PoseGenerator> MakePoseGenerator(const Plan& plan, const geometry::Surface& surface,
                                                 uint64_t seed) {
  return MakeGenerator(plan, surface.bounds(), &surface, seed);
}

std::unique_ptr<PoseGenerator> MakePoseGenerator(const Plan& plan, const geometry::Bounds& bounds,
                                                 uint64_t seed) {
  return MakeGenerator(plan, bounds, nullptr, seed);
}

CommandedTouch TouchOfPlan(const Plan& plan, const PoseGenerator& generator, uint64_t number,
                           uint32_t attempt) {
  if (plan.kind == Plan::Kind::kList) return plan.list[number % plan.list.size()];
  CommandedTouch touch;
  generator.Draw({&number, 1}, attempt, &touch);
  touch.speed_m_s = plan.speed_m_s;
  touch.session_time_s = number * plan.touch_interval_s;
  return touch;
}

}  // namespace touchstone::touch
