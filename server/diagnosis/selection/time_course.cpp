#include "server/diagnosis/selection/time_course.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "server/base/units.h"
#include "server/diagnosis/inference/laplace_evidence.h"
#include "server/diagnosis/selection/held_out_curve.h"
#include "server/diagnosis/selection/session_slots.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kEvenSlots = 48;  // of the session, with as many touches each: where courses may begin and end
constexpr int kMinTouchesPerSlot = 3;
constexpr int kFineSlots = 12;  // in place of each slot round the best step's beginning
constexpr int kWarmUps = 8;     // time constants, from the first to the second share of the session
constexpr double kShortestWarmUp = 0.015, kLongestWarmUp = 0.5;
constexpr int kWarmUpKnots = 16;
constexpr int kMaxCycles = 16, kFrequenciesPerCycle = 2,
              kPhases = 6;      // of waves; more cycles: a smooth curve's
constexpr int kFinerWaves = 4;  // between two frequencies or phases
constexpr int kKnotsPerCycle = 12;
constexpr double kVisibleShare = 1e-6;  // of a column's square that the fit's own columns leave
constexpr double kWorthRefiningNats = 3;

enum class CourseKind { kStep, kStretch, kWarmUp, kWave, kConstant, kLine };

// What one course explains, and how probable it is.
struct CandidateCourse {
  CourseKind kind = CourseKind::kStep;
  int begin = 0, end = 0;  // slots [begin, end)
  double constant = 0;     // time constant or period, in units of the covariate
  double phase = 0;        // of a wave at the first touch, rad
  int finger = -1;         // -1: each has a value of its own
  Eigen::VectorXd values;  // of the fingers, mm, relative to each other
  double log_evidence = -INFINITY;
};

// Where the values of a course stand in its curve.
bool IsRising(const std::vector<double>& knots) {
  const double finest = 1e-5 * (knots.back() - knots.front());  // what a file keeps of them
  for (size_t j = 1; j < knots.size(); ++j)
    if (!(knots[j] - knots[j - 1] > finest)) return false;
  return true;
}

class CourseScorer {
 public:
  CourseScorer(const inference::Experiment& experiment, const touches::TouchObservationModel& touches,
               const inference::Fit& fit, const touches::Prediction& details, const CurveCovariate& covariate)
      : experiment_(experiment),
        touches_(touches),
        fit_(fit),
        covariate_(covariate),
        fingers_(touches.observations().fingers),
        slots_(experiment, touches, fit, details, covariate) {}

  bool IsPossible() const {
    return fingers_ >= 2 && slots_.touches() >= kEvenSlots * kMinTouchesPerSlot &&
           slots_.last() > slots_.first();
  }

  void DivideEvenly() {
    std::vector<int> begins;
    for (int slot = 0; slot < kEvenSlots; ++slot)
      begins.push_back(static_cast<int>(static_cast<int64_t>(slots_.touches()) * slot / kEvenSlots));
    slots_.Divide(std::move(begins));
  }

  // Finer round where a course begins and ends; elsewhere no edge is asked for.
  void DivideRound(const CandidateCourse& course) {
    std::vector<int> begins = {0};
    for (const int edge : {course.begin, course.end}) {
      if (edge <= 0 || edge >= slots_.slots()) continue;
      const int from = slots_.Begin(edge - 1), to = slots_.Begin(edge + 1);
      for (int j = 0; j <= 2 * kFineSlots; ++j) begins.push_back(from + (to - from) * j / (2 * kFineSlots));
    }
    std::sort(begins.begin(), begins.end());
    begins.erase(std::unique(begins.begin(), begins.end()), begins.end());
    if (begins.back() == slots_.touches()) begins.pop_back();
    slots_.Divide(std::move(begins));
  }

  // The evidence of a kind over none, nats, averaged over `places` (0: as many as are tried here); `best`: the course
  // that fits best.
  double Score(CourseKind kind, double places, CandidateCourse* best) const {
    std::vector<double> logs;
    int tried = 0;
    const auto take = [&](const CandidateCourse& at, const std::vector<SessionSlots::Products>& products) {
      ++tried;
      for (int finger = -1; finger < fingers_; ++finger) {
        if (fingers_ == 2 && finger != 0) continue;  // with two fingers every course is one finger's
        CandidateCourse course = at;
        course.finger = finger;
        Evaluate(products, &course);
        logs.push_back(course.log_evidence);
        if (course.log_evidence > best->log_evidence) *best = std::move(course);
      }
    };
    std::vector<SessionSlots::Products> products(slots_.hypotheses());
    CandidateCourse course;
    course.kind = kind;
    if (kind == CourseKind::kWarmUp) {
      const double range = slots_.last() - slots_.first();
      for (int j = 0; j < kWarmUps; ++j) {
        course.constant =
            range * kShortestWarmUp * std::pow(kLongestWarmUp / kShortestWarmUp, j / (kWarmUps - 1.0));
        OfWeights(WeightsOf(course), &products);
        take(course, products);
      }
    } else if (kind == CourseKind::kWave) {
      for (const CandidateCourse& wave : Waves(places > 0 ? best : nullptr)) {
        OfWeights(WeightsOf(wave), &products);
        take(wave, products);
      }
    } else {
      // What reaches from the beginning or to the end is a step.
      for (int begin = 1; begin < slots_.slots(); ++begin)
        for (int end = kind == CourseKind::kStep ? slots_.slots() : begin + 1; end <= slots_.slots(); ++end) {
          if (kind == CourseKind::kStretch && end == slots_.slots()) continue;
          course.begin = begin, course.end = end;
          for (int h = 0; h < slots_.hypotheses(); ++h) products[h] = slots_.OfSlots(h, begin, end);
          take(course, products);
        }
    }
    if (tried == 0) return -INFINITY;
    return inference::LogSum(logs) - std::log(places > 0 ? places : tried) - slots_.base_log();
  }

  // All waves of whole and half cycles; near one of them if it is given.
  std::vector<CandidateCourse> Waves(const CandidateCourse* near) const {
    const double range = slots_.last() - slots_.first();
    std::vector<CandidateCourse> waves;
    const auto add = [&](double cycles, double phase) {
      waves.emplace_back();
      waves.back().kind = CourseKind::kWave;
      waves.back().constant = range / cycles, waves.back().phase = phase;
    };
    if (near == nullptr) {
      for (int j = kFrequenciesPerCycle; j <= kMaxCycles * kFrequenciesPerCycle; ++j)
        for (int phase = 0; phase < kPhases; ++phase)
          add(static_cast<double>(j) / kFrequenciesPerCycle, kPi * phase / kPhases);
      return waves;
    }
    const double cycles = range / near->constant;
    for (int j = -kFinerWaves; j <= kFinerWaves; ++j)
      for (int phase = -2 * kFinerWaves; phase <= 2 * kFinerWaves; ++phase)
        add(cycles + static_cast<double>(j) / (kFinerWaves * kFrequenciesPerCycle),
            near->phase + kPi * phase / (kFinerWaves * kPhases));
    return waves;
  }

  // With a place for every touch; a wave has as many as the finer grid.
  double Places(CourseKind kind) const {
    const double n = static_cast<double>(slots_.touches());
    if (kind == CourseKind::kWave)
      return static_cast<double>(kMaxCycles * kFrequenciesPerCycle * kPhases * kFinerWaves * kFinerWaves);
    return kind == CourseKind::kStep ? n : 0.5 * n * n;
  }

  // Of a constant or a line of one finger over none, averaged over the fingers.
  double ScoreOneFinger(CourseKind kind) const {
    CandidateCourse course;
    course.kind = kind;
    std::vector<SessionSlots::Products> products(slots_.hypotheses());
    OfWeights(WeightsOf(course), &products);
    std::vector<double> logs;
    for (course.finger = 0; course.finger < (fingers_ == 2 ? 1 : fingers_); ++course.finger) {
      Evaluate(products, &course);
      logs.push_back(course.log_evidence);
    }
    return inference::LogSum(logs) - slots_.base_log();
  }

  NamelessCurve Describe(const CandidateCourse& course) const {
    NamelessCurve curve;
    curve.covariate = covariate_.name;
    curve.of_time = curve.per_finger = true;
    curve.effective_dof = course.finger >= 0 ? 1 : fingers_ - 1;
    std::vector<double> shares;
    const auto edge = [&](int place, bool rises) {
      curve.knots.push_back(slots_.At(place - 1)), shares.push_back(rises ? 0 : 1);
      curve.knots.push_back(slots_.At(place)), shares.push_back(rises ? 1 : 0);
    };
    if (course.kind == CourseKind::kWave) {
      const double step = course.constant / kKnotsPerCycle;
      for (double x = slots_.first(); x < slots_.last() + step; x += step)
        curve.knots.push_back(x), shares.push_back(WaveAt(course, x));
    } else if (course.kind == CourseKind::kWarmUp) {
      for (int j = 0; j <= kWarmUpKnots; ++j) {
        // Even steps of what is left to rise, to three time constants; then one to the end.
        const double x = -course.constant * std::log(1 - 0.95 * j / kWarmUpKnots);
        if (x >= slots_.last()) break;
        curve.knots.push_back(x), shares.push_back(1 - std::exp(-x / course.constant));
      }
      curve.knots.push_back(slots_.last()), shares.push_back(1 - std::exp(-slots_.last() / course.constant));
    } else {
      edge(slots_.Begin(course.begin), true);
      // One touch alone is a peak of three knots.
      if (course.end < slots_.slots() && slots_.Begin(course.end) - slots_.Begin(course.begin) > 1)
        edge(slots_.Begin(course.end), false);
      else if (course.end < slots_.slots())
        curve.knots.push_back(slots_.At(slots_.Begin(course.end))), shares.push_back(0);
    }
    for (int i = 0; i < fingers_; ++i) {
      curve.values.emplace_back();
      for (const double share : shares) curve.values.back().push_back(share * course.values[i]);
    }
    curve.words = Words(course);
    return curve;
  }

  void HoldOut(const CandidateCourse& course, NamelessCurve* curve) const {
    Eigen::MatrixXd columns = slots_.Columns(WeightsOf(course));
    if (course.finger >= 0) columns = (columns * Direction(course.finger)).eval();
    const Eigen::MatrixXd precision = columns.transpose() * columns / touches_.rows() +
                                      Eigen::MatrixXd::Identity(columns.cols(), columns.cols()) * 1e-300;
    curve->heldout_without_s =
        HeldOutBeside(experiment_, touches_, fit_, Eigen::MatrixXd(), Eigen::MatrixXd(), true);
    curve->heldout_with_s = HeldOutBeside(experiment_, touches_, fit_, columns, precision, true);
  }

 private:
  void OfWeights(const Eigen::VectorXd& weights, std::vector<SessionSlots::Products>* products) const {
    for (int h = 0; h < slots_.hypotheses(); ++h) (*products)[h] = slots_.OfWeights(h, weights);
  }

  // Of one finger against the others, in the columns of all but the first: these add up to nothing.
  Eigen::VectorXd Direction(int finger) const {
    const int f = fingers_ - 1;
    if (finger == 0) return -Eigen::VectorXd::Ones(f);
    return Eigen::VectorXd::Unit(f, finger - 1);
  }

  // Half for one finger, half for values of each.
  double LogShare(int finger) const {
    if (fingers_ == 2) return 0;
    return std::log(finger < 0 ? 0.5 : 0.5 / fingers_);
  }

  double WaveAt(const CandidateCourse& course, double x) const {
    return std::sin(2 * kPi * (x - slots_.first()) / course.constant + course.phase);
  }

  // Of the course at one place, for a value of 1.
  double ShareAt(const CandidateCourse& course, int place) const {
    const double x = slots_.At(place);
    switch (course.kind) {
      case CourseKind::kWarmUp:
        return 1 - std::exp(-std::max(x, 0.0) / course.constant);
      case CourseKind::kWave:
        return WaveAt(course, x);
      case CourseKind::kLine:
        return x / slots_.last();
      default:
        return 1;
    }
  }

  // The course's mean over each slot.
  Eigen::VectorXd WeightsOf(const CandidateCourse& course) const {
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(slots_.slots());
    if (course.kind == CourseKind::kStep || course.kind == CourseKind::kStretch) {
      weights.segment(course.begin, course.end - course.begin).setOnes();
      return weights;
    }
    for (int slot = 0; slot < slots_.slots(); ++slot)
      for (int place = slots_.Begin(slot); place < slots_.Begin(slot + 1); ++place)
        weights[slot] += ShareAt(course, place) / (slots_.Begin(slot + 1) - slots_.Begin(slot));
    return weights;
  }

  // The values have a prior worth one row, as those of effects have. `products`: by hypothesis.
  void Evaluate(const std::vector<SessionSlots::Products>& products, CandidateCourse* course) const {
    const int f = fingers_ - 1;
    const double n = touches_.rows();
    std::vector<double> logs;
    double best = -INFINITY;
    for (int h = 0; h < slots_.hypotheses(); ++h) {
      const SessionSlots::Products& of = products[h];
      Eigen::VectorXd values = Eigen::VectorXd::Zero(fingers_);
      double drop = 0;
      if (course->finger >= 0) {
        const Eigen::VectorXd v = Direction(course->finger);
        const double square = v.dot(of.a * v), product = v.dot(of.b);
        if (square > kVisibleShare * of.plain) {
          drop = product * product / square;
          values[course->finger] = product / square;
        }
      } else if (of.a.trace() > kVisibleShare * of.plain) {
        Eigen::MatrixXd ridged = of.a;
        ridged.diagonal().array() += 1e-9 * of.a.trace();
        const Eigen::VectorXd solved = ridged.ldlt().solve(of.b);
        drop = of.b.dot(solved);
        values.tail(f) = solved;
        values.array() -= values.mean();
      }
      const int dof = course->finger >= 0 ? 1 : f;
      logs.push_back(slots_.LogLikelihood(h, n / (n + 1) * drop) - 0.5 * dof * std::log1p(n));
      if (logs.back() > best) best = logs.back(), course->values = values;
    }
    course->log_evidence = inference::LogSum(logs) + LogShare(course->finger);
  }

  // Touches have an order of their own where several sessions are one set.
  std::string TouchWord(int place) const {
    if (!slots_.InSessionOrder()) return absl::StrFormat("%.5g s of each session", slots_.At(place));
    return absl::StrCat("touch ", slots_.TouchNumber(place));
  }

  // "finger l travels 0.25 mm farther".
  std::string ValuesInWords(const CandidateCourse& course) const {
    const auto name = [&](int finger) { return model::FingerName(finger, fingers_); };
    if (course.finger >= 0) {
      const double value = course.values[course.finger];
      return absl::StrFormat("finger %s travels %.2g mm %s", name(course.finger), std::abs(value),
                             value > 0 ? "farther" : "less far");
    }
    std::string words = "the fingers travel farther by";
    for (int i = 0; i < fingers_; ++i)
      absl::StrAppendFormat(&words, "%s %s %.2g mm", i > 0 ? "," : "", name(i), course.values[i]);
    return words;
  }

  std::string Words(const CandidateCourse& course) const {
    const std::string what = ValuesInWords(course);
    const char* unit = covariate_.name == "session_time_s" ? "s" : "touches";
    switch (course.kind) {
      case CourseKind::kStep:
        return absl::StrCat("from ", TouchWord(slots_.Begin(course.begin)), " on ", what);
      case CourseKind::kStretch:
        return absl::StrCat("from ", TouchWord(slots_.Begin(course.begin)), " to ",
                            TouchWord(slots_.Begin(course.end) - 1), " ", what);
      case CourseKind::kConstant:
      case CourseKind::kLine:
        return what;
      case CourseKind::kWave:
        return absl::StrFormat("%s and back in waves with a period of %.3g %s", what, course.constant, unit);
      case CourseKind::kWarmUp:
        return absl::StrFormat("%s with a time constant of %.2g %s, and then no more", what, course.constant,
                               unit);
    }
    return what;
  }

  const inference::Experiment& experiment_;
  const touches::TouchObservationModel& touches_;
  const inference::Fit& fit_;
  const CurveCovariate& covariate_;
  const int fingers_;
  SessionSlots slots_;
};

}  // namespace

TimeCourses ScoreTimeCourses(const inference::Experiment& experiment,
                             const touches::TouchObservationModel& touches, const inference::Fit& fit,
                             const touches::Prediction& details, const CurveCovariate& covariate) {
  TimeCourses courses;
  CourseScorer scorer(experiment, touches, fit, details, covariate);
  if (!scorer.IsPossible()) return courses;
  scorer.DivideEvenly();
  courses.one_finger_constant_nats = scorer.ScoreOneFinger(CourseKind::kConstant);
  courses.one_finger_line_nats = scorer.ScoreOneFinger(CourseKind::kLine);
  for (const CourseKind kind :
       {CourseKind::kStep, CourseKind::kStretch, CourseKind::kWarmUp, CourseKind::kWave}) {
    CandidateCourse best;
    double gain_nats = scorer.Score(kind, 0, &best);
    if (!std::isfinite(gain_nats) || best.values.size() == 0) continue;
    const bool finer = kind != CourseKind::kWarmUp && gain_nats > kWorthRefiningNats;
    if (finer) {
      CandidateCourse refined = best;
      refined.log_evidence = -INFINITY;
      if (kind != CourseKind::kWave) scorer.DivideRound(best);
      const double refined_nats = scorer.Score(kind, scorer.Places(kind), &refined);
      gain_nats = std::max(gain_nats, refined_nats);
      best = refined;
    }
    NamelessCurve curve = scorer.Describe(best);
    curve.gain_nats = gain_nats;
    scorer.HoldOut(best, &curve);
    if (IsRising(curve.knots)) courses.curves.push_back(std::move(curve));
    if (finer && kind != CourseKind::kWave) scorer.DivideEvenly();
  }
  return courses;
}

}  // namespace touchstone::diagnosis::selection
