#include "tests/hidden_effects/generator/generate.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/generator/set_files.h"

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

// Poses as in measurements by faces: round each face of the bounding box, targets on the surface,
// approaches up to 32 degrees from the face's inward normal, any roll; drawn again until all fingers hit.
constexpr double kMaxTilt = 32 * M_PI / 180;
constexpr double kSpread = 0.62;
constexpr double kMaxGapMm = 55;

Command DrawCommand(const Scenario& scenario, int object, int face, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1, 1), part(0, 1);
  const Solid& solid = *scenario.objects[object];
  const Vec half = 0.5 * (solid.high_mm() - solid.low_mm()),
            centre = 0.5 * (solid.high_mm() + solid.low_mm());
  const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (int attempt = 0; attempt < 10'000; ++attempt) {
    Vec inward = Vec::Zero();
    inward[axis] = face % 2 == 0 ? -1 : 1;
    Vec outside = centre - inward * (half[axis] + 10);
    outside[u] += kSpread * half[u] * unit(random);
    outside[v] += kSpread * half[v] * unit(random);
    const Contact target = solid.FirstContact(outside, inward, 0);
    const double cosine = 1 - part(random) * (1 - std::cos(kMaxTilt));
    const double around = 2 * M_PI * part(random), roll = 2 * M_PI * part(random);
    if (!target.hit) continue;
    Vec e = Vec::Zero();
    e[u] = 1;
    const Vec lean = std::cos(around) * e + std::sin(around) * inward.cross(e);
    Command command;
    command.object = object, command.face = face, command.target_mm = target.point_mm;
    command.approach = (cosine * inward + std::sqrt(1 - cosine * cosine) * lean).normalized();
    const Vec p = (e - command.approach * command.approach.dot(e)).normalized();
    command.lateral = std::cos(roll) * p + std::sin(roll) * command.approach.cross(p);
    double min_mm = 1e300, max_mm = -1e300;
    bool all = true;
    for (int i = 0; i < scenario.fingers && all; ++i) {
      const double x = (i - 0.5 * (scenario.fingers - 1)) * scenario.spacing_mm;
      const Contact contact = solid.FirstContact(
          command.target_mm - command.approach * scenario.standoff_mm + command.lateral * x, command.approach,
          0);
      all = contact.hit;
      min_mm = std::min(min_mm, contact.travel_mm), max_mm = std::max(max_mm, contact.travel_mm);
    }
    if (all && max_mm - min_mm < kMaxGapMm) return command;
  }
  throw std::runtime_error("no pose found where all fingers hit " + solid.name());
}

// The course of a session: pauses between touches, and the room's temperature.
class Course {
 public:
  explicit Course(uint64_t seed) : clock_(Stream(seed, "clock")), room_(Stream(seed, "room")) {
    phase_ = std::uniform_real_distribution<double>(0, 2 * M_PI)(room_);
  }
  void Touch(Command command, int round, double speed_mm_s, Protocol* out) {
    command.round = round;
    now_s_ += std::uniform_real_distribution<double>(6.3, 11.7)(clock_);
    out->commands.push_back(command);
    out->session_time_s.push_back(now_s_);
    out->speed_mm_s.push_back(command.speed_mm_s > 0 ? command.speed_mm_s : speed_mm_s);
    const double degrees = 23 + 2 * std::sin(2 * M_PI * now_s_ / 3000 + phase_) + 0.2 * draught_(room_);
    out->temperature.push_back(std::round(degrees * 100) / 100);
  }

 private:
  std::mt19937_64 clock_, room_;
  std::normal_distribution<double> draught_;
  double phase_ = 0, now_s_ = 0;
};

Protocol DrawProtocol(const Scenario& scenario, uint64_t seed) {
  auto poses = Stream(seed, "pose");
  Course course(seed);
  Protocol out;
  const auto& speeds = scenario.speeds_mm_s;
  for (size_t object = 0; object < scenario.objects.size(); ++object) {
    std::vector<Command> drawn;
    for (int k = 0; k < scenario.poses; ++k) {
      drawn.push_back(DrawCommand(scenario, object, 6 * k / scenario.poses, poses));
      drawn.back().pose = object * scenario.poses + k;
    }
    for (int round = 0; round < scenario.rounds; ++round)
      for (int k = 0; k < scenario.poses; ++k)
        course.Touch(drawn[k], round, speeds[(scenario.speed_by_round ? round : k) % speeds.size()], &out);
  }
  return out;
}

// Times without noise; tangents for the noise that grows with the incidence.
void Play(const Scenario& scenario, const Protocol& protocol, uint64_t seed, std::vector<double>* exact_us,
          std::vector<double>* tangents) {
  Rig rig(scenario, seed);
  for (size_t k = 0; k < protocol.commands.size(); ++k)
    for (const Rig::Finger& finger : rig.Touch(protocol.commands[k], protocol.speed_mm_s[k],
                                               protocol.session_time_s[k], protocol.temperature[k])) {
      exact_us->push_back(finger.hit ? finger.reported_s * rig.clock_factor() * 1e6 : NAN);
      if (tangents != nullptr) tangents->push_back(finger.tan_incidence);
    }
}

// Noise, polling, outliers, losses.
std::vector<double> Report(const Scenario& scenario, uint64_t seed, const Protocol& protocol,
                           const std::vector<double>& exact_us, const std::vector<double>& tangents) {
  Rig rig(scenario, seed);
  auto scatter = Stream(seed, "noise"), ticks = Stream(seed, "ticks"), losses = Stream(seed, "loss"),
       wild = Stream(seed, "wild");
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> part(0, 1);
  const double degrees = rig.Value("heavy_tail_noise", 0, 1000);
  const double slope = rig.Value("incidence_noise"), interval_us = rig.Value("poll_interval");
  const double lost = 1 - (1 - rig.Value("missed_contact")) * (1 - scenario.missing_share);
  std::vector<double> remembered_us(exact_us.size(), 0);
  std::vector<Cause> causes = scenario.causes;
  if (const double sigma_us = rig.Value("correlated_noise"); sigma_us > 0)
    causes.push_back({CauseKind::kNoiseWithMemory, sigma_us, {rig.Value("correlated_noise", 1)}, {}});
  for (const Cause& cause : causes) {
    const auto added_us = AddedNoiseUs(cause, seed, protocol.session_time_s, scenario.fingers);
    for (size_t k = 0; k < added_us.size(); ++k) remembered_us[k] += added_us[k];
  }
  std::vector<double> out(exact_us.size());
  double phase_us = 0;
  for (size_t k = 0; k < exact_us.size(); ++k) {
    double deviate = normal(scatter);
    if (degrees < 1000)
      deviate /= std::sqrt(std::gamma_distribution<double>(degrees / 2, 2 / degrees)(scatter));
    double time_us = exact_us[k] + remembered_us[k] +
                     scenario.sigma_us * (1 + slope * tangents[k]) * deviate * rig.clock_factor();
    if (part(wild) < scenario.outlier_share)
      time_us += scenario.outlier_us * (0.3 + 0.7 * part(wild)) * (part(wild) < 0.5 ? -1 : 1);
    if (k % scenario.fingers == 0) phase_us = interval_us * part(ticks);
    if (interval_us > 0) time_us = std::ceil((time_us - phase_us) / interval_us) * interval_us + phase_us;
    out[k] = part(losses) < lost ? NAN : time_us;
  }
  return out;
}

Set Played(const Scenario& scenario, const Protocol& protocol, uint64_t seed) {
  Set set;
  set.truth = scenario;
  set.touches = protocol.commands.size();
  set.commands = protocol.commands;
  set.speed_mm_s = protocol.speed_mm_s;
  set.session_time_s = protocol.session_time_s;
  set.temperature = protocol.temperature;
  std::vector<double> tangents;
  Play(scenario, protocol, seed, &set.exact_time_us, &tangents);
  set.reported_us = Report(scenario, seed, protocol, set.exact_time_us, tangents);
  set.csv = Csv(scenario, protocol, set.reported_us);
  for (const DataError& data_error : scenario.data_errors) set.csv = WithDataError(set.csv, data_error);
  set.model_yaml = NominalYaml(scenario);
  return set;
}

}  // namespace

Set Generate(const Scenario& scenario, uint64_t seed) {
  return Played(scenario, DrawProtocol(scenario, seed), seed);
}

std::vector<Command> DrawCommands(const Scenario& scenario, int count, uint64_t seed) {
  auto poses = Stream(seed, "pose");
  std::vector<Command> commands;
  const int objects = scenario.objects.size();
  for (int k = 0; k < count; ++k)
    commands.push_back(DrawCommand(scenario, k % objects, k / objects % 6, poses));
  return commands;
}

Set GenerateFor(const Scenario& scenario, const std::vector<Command>& commands, uint64_t seed) {
  Course course(seed);
  Protocol protocol;
  for (const Command& command : commands) course.Touch(command, 0, scenario.speeds_mm_s[0], &protocol);
  return Played(scenario, protocol, seed);
}

std::vector<double> ExactTimesUs(const Scenario& scenario, const Set& like, uint64_t seed) {
  const Protocol protocol{like.commands, like.session_time_s, like.speed_mm_s, like.temperature};
  std::vector<double> exact_us;
  Play(scenario, protocol, seed, &exact_us, nullptr);
  return exact_us;
}

double SignalInStandardErrors(const std::vector<double>& a_us, const std::vector<double>& b_us, int fingers,
                              double sigma_us) {
  double sum = 0;
  for (size_t begin = 0; begin < a_us.size(); begin += fingers) {
    double mean = 0, squares = 0;
    int count = 0;
    for (int i = 0; i < fingers; ++i) {
      const double difference = a_us[begin + i] - b_us[begin + i];
      if (difference != difference) continue;
      mean += difference, squares += difference * difference, ++count;
    }
    if (count > 1) sum += squares - mean * mean / count;
  }
  return std::sqrt(std::max(0.0, sum)) / sigma_us;
}

}  // namespace touchstone::hidden
