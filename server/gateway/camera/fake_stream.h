// A stream whose pictures a test hands over one by one. A test tool.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>

#include <opencv2/core.hpp>

#include "server/gateway/camera/camera_kinds.h"

namespace touchstone::gateway::camera {

// The test's end of the cable; the camera's is Stream().
class FakeCable {
 public:
  FakeCable() : state_(std::make_shared<State>()) {}
  FakeCable(const FakeCable&) = delete;
  FakeCable& operator=(const FakeCable&) = delete;

  std::unique_ptr<PictureStream> Stream() const { return std::make_unique<End>(state_); }

  // A picture all of one grey comes.
  void Show(int grey) {
    std::lock_guard<std::mutex> lock(state_->mutex);
    state_->queue.push_back(grey);
    state_->changed.notify_all();
  }
  // A picture comes of which a part is missing.
  void ShowDamaged() { Show(kDamaged); }
  // Until the camera waits for a picture: it has dealt with all that were shown.
  void AwaitGrab() const {
    std::unique_lock<std::mutex> lock(state_->mutex);
    state_->changed.wait(lock, [this] { return state_->waits && state_->queue.empty(); });
  }
  // Cut: the stream breaks, and cannot be opened until Plug.
  void Cut() { SetPlugged(false); }
  void Plug() { SetPlugged(true); }

 private:
  static constexpr int kDamaged = -1;
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<int> queue;
    bool plugged = true, waits = false;
  };

  class End final : public PictureStream {
   public:
    explicit End(std::shared_ptr<State> state) : state_(std::move(state)) {}
    absl::Status Open() override {
      std::lock_guard<std::mutex> lock(state_->mutex);
      return state_->plugged ? absl::OkStatus() : absl::UnavailableError("the cable is cut");
    }
    bool Grab() override {
      std::unique_lock<std::mutex> lock(state_->mutex);
      state_->waits = true;
      state_->changed.notify_all();
      state_->changed.wait(lock, [this] { return !state_->plugged || !state_->queue.empty(); });
      state_->waits = false;
      if (!state_->plugged) return false;
      grey_ = state_->queue.front();
      state_->queue.pop_front();
      return true;
    }
    absl::Status Retrieve(cv::Mat* picture) override {
      if (grey_ == kDamaged) return absl::DataLossError("JPEG: no end marker (EOI)");
      *picture = cv::Mat(12, 16, CV_8UC3, cv::Scalar(grey_, grey_, grey_));
      return absl::OkStatus();
    }

   private:
    const std::shared_ptr<State> state_;
    int grey_ = 0;
  };

  void SetPlugged(bool plugged) {
    std::lock_guard<std::mutex> lock(state_->mutex);
    state_->plugged = plugged;
    state_->queue.clear();
    state_->changed.notify_all();
  }

  const std::shared_ptr<State> state_;
};

}  // namespace touchstone::gateway::camera
