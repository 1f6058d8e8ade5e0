#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>

#include "tests/rig/controller/network/net.h"
#include "tests/rig/world.h"

namespace touchstone::rig {
namespace {

using gateway::timing::PacedClock;

constexpr double kRoundingS = 1e-9;  // of the moment at which time stands
constexpr double kUnlimited = std::numeric_limits<double>::infinity();
// Host time that the parts of a manual clock may take for one step, on a busy machine.
constexpr std::chrono::seconds kStepPatience{60};

}  // namespace

SimClock::SimClock(double speedup, const std::string& file)
    : speedup_(speedup),
      manual_(false),
      paced_(file.empty() ? std::make_shared<PacedClock>() : gateway::timing::MakePacedClock(file)) {
  const double now_s = HostNowS();
  paced_->Set({now_s, 0, kUnlimited, now_s});
}

SimClock::SimClock(Manual, double speedup)
    : speedup_(speedup), manual_(true), paced_(std::make_shared<PacedClock>()) {
  const double now_s = HostNowS();
  paced_->Set({now_s, 0, 0, now_s});
}

double SimClock::NowS() const {
  return paced_->Get().SinceS(HostNowS()) * speedup_;
}

double SimClock::HostS() const {
  const PacedClock::Course course = paced_->Get();
  return course.began_s + course.SinceS(HostNowS());
}

bool SimClock::Stands() const {
  return HostNowS() >= paced_->Get().StandsFromS();
}

void SimClock::SetUntil(double until_s) {
  PacedClock::Course course = paced_->Get();
  const double now_s = HostNowS();
  // What stood still goes on from where it stood.
  course.since_s = course.SinceS(now_s);
  course.steady_s = now_s;
  course.until_s = std::max(course.until_s < kUnlimited ? course.until_s : course.since_s, until_s);
  paced_->Set(course);
}

void SimClock::Move() {
  double done_s = kUnlimited;
  for (const Part* part : parts_) done_s = std::min(done_s, part->done_s_);
  SetUntil(done_s / speedup_ + kAheadHostS);
}

void SimClock::MoveBy(double sim_s, double step_s) {
  if (!manual_) throw std::logic_error("only a manual clock is moved");
  const double end_s = NowS() + sim_s;
  for (double at_s = NowS(); at_s < end_s;) {
    at_s = end_s - at_s > 1.5 * step_s ? at_s + step_s : end_s;
    std::unique_lock<std::mutex> lock(mutex_);
    PacedClock::Course course = paced_->Get();
    course.since_s = course.until_s = at_s / speedup_;
    paced_->Set(course);
    for (const Part* part : parts_) part->wake_();
    const double now_s = NowS();
    if (!done_.wait_for(lock, kStepPatience, [&] {
          return std::all_of(parts_.begin(), parts_.end(),
                             [&](const Part* part) { return part->done_s_ >= now_s; });
        }))
      throw std::runtime_error("a part of the emulated rig does not follow its clock");
  }
}

SimClock::Part::Part(SimClock* clock, std::function<void()> wake)
    : clock_(clock), wake_(std::move(wake)), done_s_(clock->NowS()) {
  const std::lock_guard<std::mutex> lock(clock_->mutex_);
  clock_->parts_.push_back(this);
  if (!clock_->manual_) clock_->Move();
}

SimClock::Part::~Part() {
  const std::lock_guard<std::mutex> lock(clock_->mutex_);
  auto& parts = clock_->parts_;
  parts.erase(std::find(parts.begin(), parts.end(), this));
  if (!clock_->manual_) clock_->Move();
  clock_->done_.notify_all();
}

void SimClock::Part::Done(double sim_s) {
  const std::lock_guard<std::mutex> lock(clock_->mutex_);
  done_s_ = std::max(done_s_, sim_s);
  if (clock_->manual_)
    clock_->done_.notify_all();
  else
    clock_->Move();
}

bool SimClock::Part::OthersDone(double sim_s) const {
  const std::lock_guard<std::mutex> lock(clock_->mutex_);
  const double due_s = sim_s - kRoundingS;
  return clock_->NowS() >= due_s &&
         std::all_of(clock_->parts_.begin(), clock_->parts_.end(),
                     [&](const Part* part) { return part == this || part->done_s_ >= due_s; });
}

}  // namespace touchstone::rig
