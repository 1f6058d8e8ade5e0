#include "server/gateway/timing/clock_sync.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace touchstone::gateway::timing {
namespace {

constexpr double kKeptS = 240;
constexpr double kBucketS = 0.25;  // of each bucket the best bounds are kept
constexpr int kKeptInBucket = 5;
constexpr double kRateDrift = 2e-8;   // change of rate in a second: 1.2 ppm a minute
constexpr double kMaxRate = 1e-3;     // off the nominal one
constexpr double kRateSpread = 2e-4;  // standard, before anything is known
constexpr double kAsymmetry = 0.1;    // standard, of the shortest round trip
constexpr double kMinScaleS = 5e-7;   // ticks are whole
constexpr size_t kContradictions = 4;
constexpr double kSettledS = 0.2;

// Bounds closer than this count as part of the envelope.
double Loosening(double age_s) {
  return 0.5 * kRateDrift * age_s * age_s;
}

}  // namespace

// Bounds from one side, loosened by age, as seen from the newest message (x = 0). From above: sign +1; from
// below: sign -1, mirrored, so that the envelope is always the highest line that is below all of them.
struct ClockSync::Side {
  struct Point {
    double x, y;
  };
  std::vector<Point> points;
  std::vector<Point> hull;  // the only ones that a line from below can touch
  double scale_s = 0;       // mean distance of the envelope from the truth

  // The height at `centre` of the highest line of this slope.
  double Height(double slope, double centre) const {
    double height = std::numeric_limits<double>::infinity();
    for (const Point& point : hull) height = std::min(height, point.y - slope * (point.x - centre));
    return height;
  }

  // How dense the bounds lie at the envelope gives its distance from the truth: of a Poisson process the
  // k-th nearest lies k scales away. Two of them the line touches itself. Also adds where the nearest
  // are to `sum`.
  void Measure(double slope, double shortest_s, double* sum, int* count) {
    const double height = Height(slope, 0);
    std::vector<std::pair<double, double>> near;
    near.reserve(points.size());
    for (const Point& point : points) near.emplace_back(point.y - slope * point.x - height, point.x);
    const size_t size = near.size();
    const size_t kept = std::min<size_t>(size, 24);
    std::partial_sort(near.begin(), near.begin() + kept, near.end());
    const size_t k = std::min<size_t>(12, size / 2);
    if (k >= 4) {
      scale_s = near[k - 1].first / (k - 2.0);
    } else {
      double mean = 0;
      for (size_t i = 0; i < kept; ++i) mean += near[i].first / kept;
      scale_s = (mean + 0.5 * shortest_s) / size;
    }
    scale_s = std::max(scale_s, kMinScaleS);
    for (size_t i = 0; i < kept; ++i) *sum += near[i].second;
    *count += static_cast<int>(kept);
  }
};

ClockSync::ClockSync(double nominal_rate) : nominal_rate_(nominal_rate) {}

void ClockSync::Reset() {
  *this = ClockSync(nominal_rate_);
}

double ClockSync::Ahead(double remote_s, double host_s) const {
  return (remote_s - base_remote_s_) / nominal_rate_ - (host_s - base_host_s_);
}

void ClockSync::AddRoundTrip(double host_send_s, double remote_receive_s, double remote_send_s,
                             double host_receive_s) {
  if (!std::isfinite(host_send_s + remote_receive_s + remote_send_s + host_receive_s)) return;
  if (host_receive_s < host_send_s || remote_send_s < remote_receive_s) return;
  Add({host_send_s, remote_receive_s, remote_send_s, host_receive_s, false});
}

void ClockSync::AddOneWay(double remote_s, double host_receive_s, double assumed_delay_s) {
  if (!std::isfinite(remote_s + host_receive_s + assumed_delay_s)) return;
  assumed_delay_s_ = assumed_delay_s;
  Add({host_receive_s, remote_s, remote_s, host_receive_s, true});
}

void ClockSync::Add(const Message& message) {
  if (begun_ && Contradicts(message)) {
    aside_.push_back(message);
    if (aside_.size() < kContradictions) return;
    // So many in succession are no accident: they are the clock now, if they agree with each other.
    const std::vector<Message> aside = std::move(aside_);
    const double assumed_delay_s = assumed_delay_s_;
    Reset();
    assumed_delay_s_ = assumed_delay_s;
    for (const Message& each : aside) Add(each);
    return;
  }
  aside_.clear();
  Take(message);
}

bool ClockSync::Contradicts(const Message& message) const {
  const ClockEstimate estimate = Estimate();
  if (!estimate.valid) return false;
  const double since_s = std::max(0.0, message.host_receive_s - estimate.host_at_s);
  const double unsure_s = 8 * (estimate.offset_uncertainty_s + estimate.rate_uncertainty * since_s) +
                          nominal_rate_ * (Loosening(since_s) + 1e-4 + 0.5 * shortest_round_trip_s_);
  if (message.remote_send_s > estimate.RemoteOf(message.host_receive_s) + unsure_s) return true;
  if (!message.one_way) return message.remote_receive_s < estimate.RemoteOf(message.host_send_s) - unsure_s;
  // A message of one way is bounded by nothing from above but sense: ten seconds late is another clock.
  return message.remote_send_s < estimate.RemoteOf(message.host_receive_s) - unsure_s - 10 * nominal_rate_;
}

void ClockSync::Take(const Message& message) {
  if (!begun_) {
    begun_ = true;
    base_host_s_ = message.host_receive_s;
    base_remote_s_ = message.remote_send_s;
  }
  const double send_s = message.host_send_s - base_host_s_, receive_s = message.host_receive_s - base_host_s_;
  const Bound lower{receive_s, Ahead(message.remote_send_s, message.host_receive_s)};
  if (message.one_way) {
    Insert(one_way_, lower, -1);
  } else {
    Insert(lower_, lower, -1);
    Insert(upper_, {send_s, Ahead(message.remote_receive_s, message.host_send_s)}, 1);
    const double round_trip_s =
        (receive_s - send_s) - (message.remote_send_s - message.remote_receive_s) / nominal_rate_;
    if (round_trips_ == 0 || round_trip_s < shortest_round_trip_s_)
      shortest_round_trip_s_ = std::max(0.0, round_trip_s);
    ++round_trips_;
  }
  newest_host_s_ = std::max(newest_host_s_, receive_s);
  for (std::deque<Bound>* bounds : {&upper_, &lower_, &one_way_})
    while (!bounds->empty() && bounds->front().host_s < newest_host_s_ - kKeptS) bounds->pop_front();
  stale_ = true;
}

void ClockSync::Insert(std::deque<Bound>& bounds, Bound bound, double sign) {
  auto place = bounds.end();
  while (place != bounds.begin() && std::prev(place)->host_s > bound.host_s) --place;
  place = bounds.insert(place, bound);

  // Of each bucket the bounds that bind least go first.
  const double bucket = std::floor(bound.host_s / kBucketS);
  auto first = place, last = place;
  const auto within = [&](const Bound& other) { return std::floor(other.host_s / kBucketS) == bucket; };
  while (first != bounds.begin() && within(*std::prev(first))) --first;
  while (last != bounds.end() && within(*last)) ++last;
  if (last - first <= kKeptInBucket) return;
  const double slope = estimate_.valid ? estimate_.rate / nominal_rate_ - 1 : 0;
  const auto tightness = [&](const Bound& a, const Bound& b) {
    return sign * (a.ahead_s - slope * a.host_s) < sign * (b.ahead_s - slope * b.host_s);
  };
  bounds.erase(std::max_element(first, last, tightness));
}

ClockSync::Side ClockSync::Prepare(const std::deque<Bound>& bounds, double from_host_s, double sign) const {
  Side side;
  side.points.reserve(bounds.size());
  for (const Bound& bound : bounds) {
    if (bound.host_s < from_host_s) continue;
    const double x = bound.host_s - newest_host_s_;
    side.points.push_back({x, sign * bound.ahead_s + Loosening(x)});
  }
  std::vector<Side::Point>& hull = side.hull;
  for (const Side::Point& point : side.points) {
    while (hull.size() >= 2) {
      const Side::Point &a = hull[hull.size() - 2], &b = hull.back();
      if ((b.x - a.x) * (point.y - a.y) - (b.y - a.y) * (point.x - a.x) > 0) break;
      hull.pop_back();
    }
    hull.push_back(point);
  }
  return side;
}

ClockEstimate ClockSync::Estimate() const {
  if (!begun_) return {};
  // A settled clock changes little from message to message.
  const bool settled = estimate_.valid && upper_.size() + one_way_.size() > 200;
  if (!stale_ || (settled && newest_host_s_ - estimated_at_s_ < kSettledS)) return estimate_;
  stale_ = false;
  estimated_at_s_ = newest_host_s_;
  // Bounds that leave no room for any line: the clock changed faster than it should. The old ones go.
  for (double window_s = kKeptS; window_s > 0.1; window_s /= 2)
    if (Fit(window_s, &estimate_)) break;
  estimate_.round_trips = round_trips_;
  estimate_.shortest_round_trip_s = shortest_round_trip_s_;
  return estimate_;
}

// The excess of a delay over the least one is dense near zero, so that among n bounds the envelope is off by
// about the scale s (one n-th of the mean excess). Then a line below the upper bounds and above the lower
// ones is likely as exp((height of the upper line) / s_upper - (height of the lower line) / s_lower), at the
// bounds' mean time, which integrates in closed form over both heights and leaves a sum over the slope.
bool ClockSync::Fit(double window_s, ClockEstimate* estimate) const {
  const double from_s = newest_host_s_ - window_s;
  const bool both = !upper_.empty() && upper_.back().host_s >= from_s && lower_.back().host_s >= from_s;
  Side upper = both ? Prepare(upper_, from_s, 1) : Side();
  Side lower = Prepare(both ? lower_ : one_way_, from_s, -1);
  if (lower.points.empty() || (both && upper.points.empty())) return false;

  double centre = 0;
  const double usual = 0.25 * window_s;
  for (const Side::Point& point : lower.points) centre += std::max(point.x, -usual) / lower.points.size();
  double upper_scale_s = 1e-5, lower_scale_s = 1e-5;
  const auto likelihood = [&](double slope) {
    double sum = lower.Height(-slope, centre) / lower_scale_s;
    if (both) sum += upper.Height(slope, centre) / upper_scale_s;
    return sum - 0.5 * slope * slope / (kRateSpread * kRateSpread);
  };
  const auto best_slope = [&] {
    double low = -kMaxRate, high = kMaxRate;
    for (int i = 0; i < 60; ++i) {  // concave: the golden rule's poor cousin is quick enough
      const double a = low + (high - low) * 0.4, b = low + (high - low) * 0.6;
      (likelihood(a) < likelihood(b) ? low : high) = likelihood(a) < likelihood(b) ? a : b;
    }
    return 0.5 * (low + high);
  };

  // Once with guessed scales, then with those that are found.
  double slope = best_slope();
  for (int pass = 0; pass < 2; ++pass) {
    double sum = 0;
    int count = 0;
    lower.Measure(-slope, shortest_round_trip_s_, &sum, &count);
    lower_scale_s = lower.scale_s;
    if (both) {
      upper.Measure(slope, shortest_round_trip_s_, &sum, &count);
      upper_scale_s = upper.scale_s;
    }
    centre = sum / count;
    slope = best_slope();
  }
  if (both && upper.Height(slope, 0) + lower.Height(-slope, 0) < -2e-6) return false;

  // The sum over slopes that are not hopeless.
  const double top = likelihood(slope);
  double reach[2];
  for (int end = 0; end < 2; ++end) {
    const double limit = end == 0 ? -kMaxRate : kMaxRate;
    double inside = 0, outside = limit - slope;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (inside + outside);
      (likelihood(slope + middle) > top - 16 ? inside : outside) = middle;
    }
    reach[end] = outside;
  }
  double weights = 0, slope_sum = 0, slope_squares = 0, height_sum = 0, height_squares = 0;
  const double near =
      both ? 0.5 * (upper.Height(slope, 0) - lower.Height(-slope, 0)) : -lower.Height(-slope, 0);
  constexpr int kSteps = 64;
  for (int i = 0; i < kSteps; ++i) {
    const double off = reach[0] + (reach[1] - reach[0]) * (i + 0.5) / kSteps;
    const double weight = std::exp(likelihood(slope + off) - top);
    double height = -lower.Height(-slope - off, 0);
    if (both) height = 0.5 * (upper.Height(slope + off, 0) + height);
    weights += weight;
    slope_sum += weight * off;
    slope_squares += weight * off * off;
    height_sum += weight * (height - near);
    height_squares += weight * (height - near) * (height - near);
  }
  const double slope_off = slope_sum / weights, height_off = height_sum / weights;
  double variance = std::max(0.0, height_squares / weights - height_off * height_off);
  double ahead = near + height_off;
  if (both) {
    ahead += 0.5 * (lower_scale_s - upper_scale_s);
    variance += 0.25 * (lower_scale_s * lower_scale_s + upper_scale_s * upper_scale_s);
    variance += std::pow(kAsymmetry * shortest_round_trip_s_, 2);
  } else {
    ahead += lower_scale_s + assumed_delay_s_;
    variance += lower_scale_s * lower_scale_s + assumed_delay_s_ * assumed_delay_s_;
  }
  estimate->valid = true;
  estimate->host_at_s = base_host_s_ + newest_host_s_;
  estimate->remote_at_s = base_remote_s_ + nominal_rate_ * (newest_host_s_ + ahead);
  estimate->rate = nominal_rate_ * (1 + slope + slope_off);
  const double slope_variance = std::max(0.0, slope_squares / weights - slope_off * slope_off);
  estimate->offset_uncertainty_s = nominal_rate_ * std::sqrt(variance + kMinScaleS * kMinScaleS);
  // The rate of now is not that of the time over which it was measured.
  estimate->rate_uncertainty = nominal_rate_ * std::sqrt(slope_variance + std::pow(kRateDrift * centre, 2));
  return true;
}

}  // namespace touchstone::gateway::timing
