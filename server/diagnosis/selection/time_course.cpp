#include "server/diagnosis/selection/time_course.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "server/base/units.h"
#include "server/diagnosis/inference/laplace_evidence.h"
#include "server/diagnosis/selection/held_out_curve.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kSlots = 48;  // of the session, with as many touches each: where courses may begin and end
constexpr int kMinTouchesPerSlot = 3;
constexpr int kFineSlots = 12;  // in place of each slot round the best step's beginning
constexpr int kWarmUps = 8;     // time constants, from the first to the second share of the session
constexpr double kShortestWarmUp = 0.015, kLongestWarmUp = 0.5;
constexpr int kWarmUpKnots = 16;
constexpr double kVisibleShare = 1e-6;  // of a column's square that the fit's own columns leave
constexpr double kWorthRefiningNats = 3;

enum class Kind { kStep, kStretch, kWarmUp };

// What one course explains, and how probable it is.
struct Course {
  Kind kind = Kind::kStep;
  int begin = 0, end = 0;  // slots [begin, end)
  double constant = 0;     // of a warm-up, in units of the covariate
  int finger = -1;         // -1: each has a value of its own
  Eigen::VectorXd values;  // of the fingers, mm, relative to each other
  double log_evidence = -INFINITY;
};

class CourseScorer {
 public:
  CourseScorer(const inference::Experiment& experiment, const touches::TouchObservationModel& touches,
               const inference::Fit& fit, const touches::Prediction& details, const CurveCovariate& covariate)
      : likelihood_(*experiment.likelihood),
        touches_(touches),
        o_(touches.observations()),
        fit_(fit),
        details_(details),
        covariate_(covariate) {
    for (const int k : touches_.contrasts().touches())
      if (std::isfinite(covariate_.value(k, 0))) order_.push_back(k);
    std::sort(order_.begin(), order_.end());
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int a, int b) { return covariate_.value(a, 0) < covariate_.value(b, 0); });
    hypotheses_ = {0};
    if (fit_.hypothesis != 0) hypotheses_.push_back(fit_.hypothesis);
  }

  bool IsPossible() const {
    return o_.fingers >= 2 && static_cast<int>(order_.size()) >= kSlots * kMinTouchesPerSlot &&
           At(static_cast<int>(order_.size()) - 1) > At(0);
  }

  // Slots begin at these places of the touches in order; the first is 0.
  void Divide(std::vector<int> begins) {
    begins_ = std::move(begins);
    begins_.push_back(static_cast<int>(order_.size()));
    slots_ = static_cast<int>(begins_.size()) - 1;
    const int f = o_.fingers - 1;
    basis_ = Eigen::MatrixXd::Zero(touches_.rows(), slots_ * f);
    std::vector<double> per_finger(o_.time_s.size());
    for (int slot = 0; slot < slots_; ++slot)
      for (int c = 0; c < f; ++c) {
        std::fill(per_finger.begin(), per_finger.end(), 0);
        for (int place = begins_[slot]; place < begins_[slot + 1]; ++place) {
          const size_t e = static_cast<size_t>(order_[place]) * o_.fingers + c + 1;
          const double slope = kMetresPerMillimetre * details_.inverse_speed_s_per_m[e];
          per_finger[e] = std::isfinite(slope) ? slope : 0;
        }
        basis_.col(slot * f + c) = touches_.contrasts().Apply(per_finger);
      }
    const inference::Likelihood::Columns all =
        inference::Likelihood::Join(fit_.columns, likelihood_.Prepare(basis_));
    forms_.clear();
    std::vector<double> base;
    for (const int s : hypotheses_) {
      forms_.push_back(Form(likelihood_.Gram(all, s), s));
      base.push_back(likelihood_.LogPrior(s) + likelihood_.LogLikelihood(forms_.back().q, s));
    }
    base_log_ = inference::LogSum(base);
  }

  void DivideEvenly() {
    std::vector<int> begins;
    for (int slot = 0; slot < kSlots; ++slot)
      begins.push_back(static_cast<int>(order_.size() * static_cast<size_t>(slot) / kSlots));
    Divide(std::move(begins));
  }

  // Finer where a course begins and ends, and coarse elsewhere.
  void DivideRound(const Course& course) {
    std::vector<int> begins = begins_;
    begins.pop_back();
    for (const int edge : {course.begin, course.end}) {
      if (edge <= 0 || edge >= slots_) continue;
      const int from = begins_[edge - 1], to = begins_[edge + 1];
      for (int j = 1; j < 2 * kFineSlots; ++j) begins.push_back(from + (to - from) * j / (2 * kFineSlots));
    }
    std::sort(begins.begin(), begins.end());
    begins.erase(std::unique(begins.begin(), begins.end()), begins.end());
    // Slots of which no edge is near hold nothing that is asked for now.
    std::vector<int> kept;
    for (const int begin : begins) {
      bool near = begin == 0;
      for (const int edge : {course.begin, course.end})
        if (edge > 0 && edge < slots_) near |= begin >= begins_[edge - 1] && begin <= begins_[edge + 1];
      if (near) kept.push_back(begin);
    }
    Divide(std::move(kept));
  }

  // The evidence of a kind over none, nats, averaged over `places` (0: as many as are tried here); `best`: the course
  // that fits best.
  double Score(Kind kind, double places, Course* best) const {
    std::vector<double> logs;
    best->log_evidence = -INFINITY;
    int tried = 0;
    const auto take = [&](const Course& at, const std::vector<Products>& products) {
      ++tried;
      for (int finger = -1; finger < o_.fingers; ++finger) {
        if (o_.fingers == 2 && finger != 0) continue;  // with two fingers every course is one finger's
        Course course = at;
        course.finger = finger;
        Evaluate(products, &course);
        logs.push_back(course.log_evidence);
        if (course.log_evidence > best->log_evidence) *best = std::move(course);
      }
    };
    std::vector<Products> products(forms_.size());
    Course course;
    course.kind = kind;
    if (kind == Kind::kWarmUp) {
      const double range = At(static_cast<int>(order_.size()) - 1) - At(0);
      for (int j = 0; j < kWarmUps; ++j) {
        course.constant =
            range * kShortestWarmUp * std::pow(kLongestWarmUp / kShortestWarmUp, j / (kWarmUps - 1.0));
        for (size_t h = 0; h < forms_.size(); ++h)
          products[h] = OfWeights(forms_[h], WarmUpWeights(course.constant));
        take(course, products);
      }
    } else {
      // What reaches from the beginning or to the end is a step.
      for (int begin = 1; begin < slots_; ++begin)
        for (int end = kind == Kind::kStep ? slots_ : begin + 1; end <= slots_; ++end) {
          if (kind == Kind::kStretch && end == slots_) continue;
          course.begin = begin, course.end = end;
          for (size_t h = 0; h < forms_.size(); ++h) products[h] = OfSlots(forms_[h], begin, end);
          take(course, products);
        }
    }
    if (tried == 0) return -INFINITY;
    return inference::LogSum(logs) - std::log(places > 0 ? places : tried) - base_log_;
  }

  // With a place for every touch.
  double Places(Kind kind) const {
    const double n = static_cast<double>(order_.size());
    return kind == Kind::kStep ? n : 0.5 * n * n;
  }

  NamelessCurve Describe(const Course& course) const {
    NamelessCurve curve;
    curve.covariate = covariate_.name;
    curve.of_time = curve.per_finger = true;
    curve.effective_dof = course.finger >= 0 ? 1 : o_.fingers - 1;
    std::vector<double> shares;
    const int n = static_cast<int>(order_.size());
    const auto edge = [&](int place, bool rises) {
      curve.knots.push_back(At(place - 1)), shares.push_back(rises ? 0 : 1);
      if (!(At(place) > At(place - 1))) curve.knots.back() = std::nextafter(At(place), -INFINITY);
      curve.knots.push_back(At(place)), shares.push_back(rises ? 1 : 0);
    };
    if (course.kind == Kind::kWarmUp) {
      for (int j = 0; j <= kWarmUpKnots; ++j) {
        // Even steps of what is left to rise, to three time constants; then one to the end.
        const double x = -course.constant * std::log(1 - 0.95 * j / kWarmUpKnots);
        if (x >= At(n - 1)) break;
        curve.knots.push_back(x), shares.push_back(1 - std::exp(-x / course.constant));
      }
      curve.knots.push_back(At(n - 1)), shares.push_back(1 - std::exp(-At(n - 1) / course.constant));
    } else {
      edge(begins_[course.begin], true);
      if (course.end < slots_) {
        if (begins_[course.end] - begins_[course.begin] > 1)
          edge(begins_[course.end], false);
        else
          curve.knots.push_back(At(begins_[course.end])), shares.push_back(0);
      }
    }
    for (int i = 0; i < o_.fingers; ++i) {
      curve.values.emplace_back();
      for (const double share : shares) curve.values.back().push_back(share * course.values[i]);
    }
    curve.words = Words(course);
    return curve;
  }

  void HoldOut(const inference::Experiment& experiment, const Course& course, NamelessCurve* curve) const {
    const int f = o_.fingers - 1;
    const Eigen::VectorXd weights = WeightsOf(course);
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(touches_.rows(), f);
    for (int slot = 0; slot < slots_; ++slot) columns += weights[slot] * basis_.middleCols(slot * f, f);
    if (course.finger >= 0) columns = (columns * Direction(course.finger)).eval();
    const Eigen::MatrixXd precision = columns.transpose() * columns / touches_.rows() +
                                      Eigen::MatrixXd::Identity(columns.cols(), columns.cols()) * 1e-300;
    curve->heldout_without_s =
        HeldOutBeside(experiment, touches_, fit_, Eigen::MatrixXd(), Eigen::MatrixXd(), true);
    curve->heldout_with_s = HeldOutBeside(experiment, touches_, fit_, columns, precision, true);
  }

 private:
  // Under one hypothesis of the surface, with the fit's own columns projected out.
  struct QuadraticForm {
    int s = 0;
    double q = 0;
    Eigen::VectorXd b, plain;  // plain: squares of the columns before the projection
    Eigen::MatrixXd a;
    // Sums over the slots before i (and before j), so that those of any stretch are differences.
    Eigen::MatrixXd b_before, a_before;  // [finger, slot]; [slot * fingers + finger, the same]
    Eigen::VectorXd plain_before;
  };

  // Of the columns of one course: its products under one hypothesis.
  struct Products {
    Eigen::MatrixXd a;
    Eigen::VectorXd b;
    double plain = 0;
  };

  double At(int place) const { return covariate_.value(order_[place], 0); }

  QuadraticForm Form(const Eigen::MatrixXd& gram, int s) const {
    const int p = fit_.model.size(), m = static_cast<int>(gram.cols()) - 1 - p;
    QuadraticForm form;
    form.s = s;
    form.q = gram(0, 0);
    form.a = gram.bottomRightCorner(m, m);
    form.b = gram.col(0).tail(m);
    form.plain = form.a.diagonal();
    if (p > 0) {
      Eigen::MatrixXd jj = gram.block(1, 1, p, p);
      for (int i = 0; i < p; ++i) jj(i, i) *= 1 + 1e-9, jj(i, i) += 1e-300;
      const Eigen::LDLT<Eigen::MatrixXd> solver(jj);
      const Eigen::VectorXd own = solver.solve(gram.block(1, 0, p, 1));
      const Eigen::MatrixXd cross = gram.block(1, 1 + p, p, m);
      form.q -= gram.block(1, 0, p, 1).col(0).dot(own);
      form.a -= cross.transpose() * solver.solve(cross);
      form.b -= cross.transpose() * own;
    }
    AddSums(&form);
    return form;
  }

  void AddSums(QuadraticForm* form) const {
    const int f = o_.fingers - 1;
    form->b_before = Eigen::MatrixXd::Zero(f, slots_ + 1);
    form->plain_before = Eigen::VectorXd::Zero(slots_ + 1);
    form->a_before = Eigen::MatrixXd::Zero((slots_ + 1) * f, (slots_ + 1) * f);
    for (int i = 0; i < slots_; ++i) {
      form->b_before.col(i + 1) = form->b_before.col(i) + form->b.segment(i * f, f);
      form->plain_before[i + 1] = form->plain_before[i] + form->plain.segment(i * f, f).sum();
      for (int j = 0; j < slots_; ++j)
        form->a_before.block((i + 1) * f, (j + 1) * f, f, f) =
            form->a_before.block(i * f, (j + 1) * f, f, f) + form->a_before.block((i + 1) * f, j * f, f, f) -
            form->a_before.block(i * f, j * f, f, f) + form->a.block(i * f, j * f, f, f);
    }
  }

  Products OfSlots(const QuadraticForm& form, int begin, int end) const {
    const int f = o_.fingers - 1;
    const auto sum = [&](int i, int j) { return form.a_before.block(i * f, j * f, f, f); };
    return {sum(end, end) - sum(begin, end) - sum(end, begin) + sum(begin, begin),
            form.b_before.col(end) - form.b_before.col(begin),
            form.plain_before[end] - form.plain_before[begin]};
  }

  Products OfWeights(const QuadraticForm& form, const Eigen::VectorXd& weights) const {
    const int f = o_.fingers - 1;
    Products of{Eigen::MatrixXd::Zero(f, f), Eigen::VectorXd::Zero(f), 0};
    for (int i = 0; i < slots_; ++i) {
      of.b += weights[i] * form.b.segment(i * f, f);
      of.plain += weights[i] * weights[i] * form.plain.segment(i * f, f).sum();
      for (int j = 0; j < slots_; ++j) of.a += weights[i] * weights[j] * form.a.block(i * f, j * f, f, f);
    }
    return of;
  }

  // Of one finger against the others, in the columns of all but the first: these add up to nothing.
  Eigen::VectorXd Direction(int finger) const {
    const int f = o_.fingers - 1;
    if (finger == 0) return -Eigen::VectorXd::Ones(f);
    return Eigen::VectorXd::Unit(f, finger - 1);
  }

  // Half for one finger, half for values of each.
  double LogShare(int finger) const {
    if (o_.fingers == 2) return 0;
    return std::log(finger < 0 ? 0.5 : 0.5 / o_.fingers);
  }

  Eigen::VectorXd WarmUpWeights(double constant) const {
    Eigen::VectorXd weights(slots_);
    for (int slot = 0; slot < slots_; ++slot) {
      double sum = 0;
      for (int place = begins_[slot]; place < begins_[slot + 1]; ++place)
        sum += 1 - std::exp(-std::max(At(place), 0.0) / constant);
      weights[slot] = sum / std::max(1, begins_[slot + 1] - begins_[slot]);
    }
    return weights;
  }

  Eigen::VectorXd WeightsOf(const Course& course) const {
    if (course.kind == Kind::kWarmUp) return WarmUpWeights(course.constant);
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(slots_);
    weights.segment(course.begin, course.end - course.begin).setOnes();
    return weights;
  }

  // The values have a prior worth one row, as those of effects have. `products`: by hypothesis.
  void Evaluate(const std::vector<Products>& products, Course* course) const {
    const int f = o_.fingers - 1;
    const double n = touches_.rows();
    std::vector<double> logs;
    double best = -INFINITY;
    for (size_t h = 0; h < forms_.size(); ++h) {
      const QuadraticForm& form = forms_[h];
      const Products& of = products[h];
      Eigen::VectorXd values = Eigen::VectorXd::Zero(o_.fingers);
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
      const double q = form.q - n / (n + 1) * drop;
      const int dof = course->finger >= 0 ? 1 : f;
      logs.push_back(likelihood_.LogPrior(form.s) + likelihood_.LogLikelihood(q, form.s) -
                     0.5 * dof * std::log1p(n));
      if (logs.back() > best) best = logs.back(), course->values = values;
    }
    course->log_evidence = inference::LogSum(logs) + LogShare(course->finger);
  }

  // Touches have an order of their own where several sessions are one set.
  std::string TouchWord(int place) const {
    if (!std::is_sorted(order_.begin(), order_.end()))
      return absl::StrFormat("%.5g s of each session", At(place));
    return absl::StrCat("touch ", o_.set->touch[o_.row[order_[place]]]);
  }

  // "finger l travels 0.25 mm farther".
  std::string ValuesInWords(const Course& course) const {
    const auto name = [&](int finger) { return model::FingerName(finger, o_.fingers); };
    if (course.finger >= 0) {
      const double value = course.values[course.finger];
      return absl::StrFormat("finger %s travels %.2g mm %s", name(course.finger), std::abs(value),
                             value > 0 ? "farther" : "less far");
    }
    std::string words = "the fingers travel farther by";
    for (int i = 0; i < o_.fingers; ++i)
      absl::StrAppendFormat(&words, "%s %s %.2g mm", i > 0 ? "," : "", name(i), course.values[i]);
    return words;
  }

  std::string Words(const Course& course) const {
    const std::string what = ValuesInWords(course);
    switch (course.kind) {
      case Kind::kStep:
        return absl::StrCat("from ", TouchWord(begins_[course.begin]), " on ", what);
      case Kind::kStretch:
        return absl::StrCat("from ", TouchWord(begins_[course.begin]), " to ",
                            TouchWord(begins_[course.end] - 1), " ", what);
      case Kind::kWarmUp:
        return absl::StrFormat("%s with a time constant of %.2g %s, and then no more", what, course.constant,
                               covariate_.name == "session_time_s" ? "s" : "touches");
    }
    return what;
  }

  const inference::Likelihood& likelihood_;
  const touches::TouchObservationModel& touches_;
  const touches::Observations& o_;
  const inference::Fit& fit_;
  const touches::Prediction& details_;
  const CurveCovariate& covariate_;
  std::vector<int> order_;  // touches by the covariate
  std::vector<int> hypotheses_;
  std::vector<int> begins_;  // of slots, and the end
  int slots_ = 0;
  Eigen::MatrixXd basis_;  // [slot * (fingers - 1) + finger - 1]
  std::vector<QuadraticForm> forms_;
  double base_log_ = 0;
};

}  // namespace

std::vector<NamelessCurve> ScoreTimeCourses(const inference::Experiment& experiment,
                                            const touches::TouchObservationModel& touches,
                                            const inference::Fit& fit, const touches::Prediction& details,
                                            const CurveCovariate& covariate) {
  std::vector<NamelessCurve> curves;
  CourseScorer scorer(experiment, touches, fit, details, covariate);
  if (!scorer.IsPossible()) return curves;
  scorer.DivideEvenly();
  for (const Kind kind : {Kind::kStep, Kind::kStretch, Kind::kWarmUp}) {
    Course best;
    double gain_nats = scorer.Score(kind, 0, &best);
    if (!std::isfinite(gain_nats) || best.values.size() == 0) continue;
    const bool finer = kind != Kind::kWarmUp && gain_nats > kWorthRefiningNats;
    if (finer) {
      Course refined;
      scorer.DivideRound(best);
      const double refined_nats = scorer.Score(kind, scorer.Places(kind), &refined);
      gain_nats = std::max(gain_nats, refined_nats);
      best = refined;
    }
    NamelessCurve curve = scorer.Describe(best);
    curve.gain_nats = gain_nats;
    scorer.HoldOut(experiment, best, &curve);
    curves.push_back(std::move(curve));
    if (finer) scorer.DivideEvenly();
  }
  return curves;
}

}  // namespace touchstone::diagnosis::selection
