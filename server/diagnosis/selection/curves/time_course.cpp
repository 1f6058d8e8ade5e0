#include "server/diagnosis/selection/curves/time_course.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "server/base/numbers/decompositions.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"
#include "server/diagnosis/selection/curves/candidate_course.h"
#include "server/diagnosis/selection/curves/held_out_curve.h"
#include "server/diagnosis/selection/curves/rules.h"
#include "server/diagnosis/selection/curves/session_slots.h"

namespace touchstone::diagnosis::selection {
namespace {

class CourseScorer {
 public:
  CourseScorer(const engine::Experiment& experiment, const touches::TouchObservationModel& touches,
               const engine::Fit& fit, const touches::Prediction& details, const CurveCovariate& covariate)
      : experiment_(experiment),
        touches_(touches),
        fit_(fit),
        covariate_(covariate),
        fingers_(touches.observations().fingers),
        slots_(experiment, touches, fit, details, covariate) {}

  bool IsPossible() const {
    return fingers_ >= 2 && slots_.touches() >= kCurveRules.even_slots * kCurveRules.min_touches_per_slot &&
           slots_.last() > slots_.first();
  }

  const SessionSlots& slots() const { return slots_; }

  void DivideEvenly() {
    std::vector<int> begins;
    for (int slot = 0; slot < kCurveRules.even_slots; ++slot)
      begins.push_back(
          static_cast<int>(static_cast<int64_t>(slots_.touches()) * slot / kCurveRules.even_slots));
    slots_.Divide(std::move(begins));
  }

  // Finer round where a course begins and ends; elsewhere no edge is asked for.
  void DivideRound(const CandidateCourse& course) {
    std::vector<int> begins = {0};
    for (const int edge : {course.begin, course.end}) {
      if (edge <= 0 || edge >= slots_.slots()) continue;
      const int from = slots_.Begin(edge - 1), to = slots_.Begin(edge + 1);
      for (int j = 0; j <= 2 * kCurveRules.fine_slots; ++j)
        begins.push_back(from + (to - from) * j / (2 * kCurveRules.fine_slots));
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
      for (int j = 0; j < kCurveRules.warm_ups; ++j) {
        course.constant = range * kCurveRules.shortest_warm_up *
                          std::pow(kCurveRules.longest_warm_up / kCurveRules.shortest_warm_up,
                                   j / (kCurveRules.warm_ups - 1.0));
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
    return engine::LogSum(logs) - std::log(places > 0 ? places : tried) - slots_.base_log();
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
      for (int j = kCurveRules.frequencies_per_cycle;
           j <= kCurveRules.max_cycles * kCurveRules.frequencies_per_cycle; ++j)
        for (int phase = 0; phase < kCurveRules.phases; ++phase)
          add(static_cast<double>(j) / kCurveRules.frequencies_per_cycle, kPi * phase / kCurveRules.phases);
      return waves;
    }
    const double cycles = range / near->constant;
    for (int j = -kCurveRules.finer_waves; j <= kCurveRules.finer_waves; ++j)
      for (int phase = -2 * kCurveRules.finer_waves; phase <= 2 * kCurveRules.finer_waves; ++phase)
        add(cycles + static_cast<double>(j) / (kCurveRules.finer_waves * kCurveRules.frequencies_per_cycle),
            near->phase + kPi * phase / (kCurveRules.finer_waves * kCurveRules.phases));
    return waves;
  }

  // With a place for every touch; a wave has as many as the finer grid.
  double Places(CourseKind kind) const {
    const double n = static_cast<double>(slots_.touches());
    if (kind == CourseKind::kWave)
      return static_cast<double>(kCurveRules.max_cycles * kCurveRules.frequencies_per_cycle *
                                 kCurveRules.phases * kCurveRules.finer_waves * kCurveRules.finer_waves);
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
    return engine::LogSum(logs) - slots_.base_log();
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

  // The course's mean over each slot.
  Eigen::VectorXd WeightsOf(const CandidateCourse& course) const {
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(slots_.slots());
    if (course.kind == CourseKind::kStep || course.kind == CourseKind::kStretch) {
      weights.segment(course.begin, course.end - course.begin).setOnes();
      return weights;
    }
    for (int slot = 0; slot < slots_.slots(); ++slot)
      for (int place = slots_.Begin(slot); place < slots_.Begin(slot + 1); ++place)
        weights[slot] += ShareAt(course, slots_, place) / (slots_.Begin(slot + 1) - slots_.Begin(slot));
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
        if (square > kCurveRules.visible * of.plain) {
          drop = product * product / square;
          values[course->finger] = product / square;
        }
      } else if (of.a.trace() > kCurveRules.visible * of.plain) {
        Eigen::MatrixXd ridged = of.a;
        ridged.diagonal().array() += 1e-9 * of.a.trace();
        const Eigen::VectorXd solved = SymmetricSolver(ridged).Solve(of.b);
        drop = of.b.dot(solved);
        values.tail(f) = solved;
        values.array() -= values.mean();
      }
      const int dof = course->finger >= 0 ? 1 : f;
      logs.push_back(slots_.LogLikelihood(h, n / (n + 1) * drop) - 0.5 * dof * std::log1p(n));
      if (logs.back() > best) best = logs.back(), course->values = values;
    }
    course->log_evidence = engine::LogSum(logs) + LogShare(course->finger);
  }

  const engine::Experiment& experiment_;
  const touches::TouchObservationModel& touches_;
  const engine::Fit& fit_;
  const CurveCovariate& covariate_;
  const int fingers_;
  SessionSlots slots_;
};

}  // namespace

TimeCourses ScoreTimeCourses(const engine::Experiment& experiment,
                             const touches::TouchObservationModel& touches, const engine::Fit& fit,
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
    const bool finer = kind != CourseKind::kWarmUp && gain_nats > kCurveRules.worth_refining;
    if (finer) {
      CandidateCourse refined = best;
      refined.log_evidence = -INFINITY;
      if (kind != CourseKind::kWave) scorer.DivideRound(best);
      const double refined_nats = scorer.Score(kind, scorer.Places(kind), &refined);
      gain_nats = std::max(gain_nats, refined_nats);
      best = refined;
    }
    NamelessCurve curve = CurveOf(best, scorer.slots(), covariate);
    curve.gain_nats = gain_nats;
    scorer.HoldOut(best, &curve);
    if (HasRisingKnots(curve)) courses.curves.push_back(std::move(curve));
    if (finer && kind != CourseKind::kWave) scorer.DivideEvenly();
  }
  return courses;
}

}  // namespace touchstone::diagnosis::selection
