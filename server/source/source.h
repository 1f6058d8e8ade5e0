// A source touches and photographs objects on request. Behind this interface stand the virtual source, which
// simulates (virtual_source.h), and the physical one (physical_source.h): a rig, or the recording of one.
//
// A source keeps nothing of a request: what a request decides is in its arguments. Every function may be called
// from several threads. SI units, object frame.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/dataset/batch_columns.h"
#include "server/dataset/specification.h"
#include "server/dataset/stream.h"
#include "server/model/model.h"
#include "server/session/journal/journal.h"
#include "server/source/motion_guard.h"
#include "server/source/object_store.h"
#include "server/source/request_checks.h"
#include "server/touch/commanded_touch.h"
#include "server/touch/draw_check.h"
#include "server/touch/plan.h"

namespace touchstone::source {

enum class SourceKind { kVirtual, kPhysical };  // the recording of a rig is a physical source too

// What a source is.
struct SourceInfo {
  SourceKind kind = SourceKind::kVirtual;
  std::vector<touch::Plan::Kind> plans;               // that make sense here
  std::shared_ptr<const model::Model> default_model;  // null: it simulates nothing
  bool makes_images = false;
  std::string renderer;              // "egl" or "cpu"; empty: none
  std::string renderer_description;  // in words; also why there is none
  int max_fingers = 0;
  bool moves = false;              // something moves, so that a lease is needed
  double touch_duration_s = 0;     // of one touch, about; 0: as fast as it computes
  double clock_uncertainty_s = 0;  // of contact times, standard; 0: exact
};

// The touches of a plan around an object, without touching it.
struct PlanRequest {
  touch::Plan plan;    // valid
  std::string object;  // not needed by a list
  uint64_t seed = 0;
  uint64_t first_index = 0, count = 0;  // count 0: to the plan's end
  // Whose fingers must all hit, with its effects; null: the source's own.
  std::shared_ptr<const model::Model> model;
  uint32_t max_draws = 1000;  // of one touch, before the plan is refused
};

struct ExpandedPlan {
  std::vector<touch::CommandedTouch> touches;
  touch::DrawCounts draws;         // that they took; none for a list
  std::vector<std::string> notes;  // what is odd about them (touch/touch_notes.h)
};

struct PreviousTouch {
  std::string object;
  touch::CommandedTouch touch;  // made exact
};

struct TouchRequest {
  std::string object;
  std::vector<touch::CommandedTouch> touches;  // made exact
  std::shared_ptr<const model::Model> model;   // that simulates; null: the default
  uint64_t seed = 0;
  uint64_t first_index = 0;      // touch k draws the random numbers of index first_index + k
  std::string session;           // that a physical source journals in; empty: "default"
  std::vector<std::string> ids;  // one per touch, or none
  // The last two that the session made before these; a physical source knows its own.
  std::vector<PreviousTouch> previous;
  bool series = false;  // a physical source also keeps and gives the arm's states during each approach
};

// One row per touch, in order. Arrays per finger: entry touch * fingers + finger.
struct TouchResults {
  int fingers = 0;
  std::vector<double> contact_time_s;  // reported, since the approach began; NaN: the finger reported nothing
  // Of a virtual source; empty at a physical one.
  std::vector<double> travel_m;
  std::vector<Eigen::Vector3d> contact_m, normal;
  std::shared_ptr<const model::Model> model;  // that simulated
  std::vector<std::string> notes;             // what is odd about the commands (touch/touch_notes.h)
  // Of a physical source: how each was made. Empty at a virtual one.
  std::string session;
  std::vector<session::JournalTouch> journalled;
  // One per touch where that was asked for; none: the touch was made without.
  std::vector<std::optional<session::JournalSeries>> series;

  size_t size() const { return fingers == 0 ? 0 : contact_time_s.size() / fingers; }
};

struct CaptureRequest {
  std::string object;
  std::vector<image::Camera> cameras;  // one per photograph; each with the image's field of view
  dataset::DatasetImage image;         // without its renderer
  // Of a virtual source: its effects of photographs act (null: those of the source's own), and picture k draws the noise
  // of (seed, first_index + k).
  std::shared_ptr<const model::Model> model;
  uint64_t seed = 0, first_index = 0;
};

// Where the camera of a physical source really was, object frame.
struct PhotographPose {
  std::optional<image::Camera> measured;  // at lies as far from the eye as commanded; none: unknown
  double unix_s = 0;
  double deviation_m = 0, deviation_rad = 0;  // from the commanded pose
};

// One row per photograph.
struct CaptureResults {
  std::vector<dataset::ColumnInfo> columns;  // "image", and "depth_m", "mask" where asked for
  dataset::DatasetBatch batch;
  // Of a physical source: where each was taken from. Empty at a virtual one.
  std::vector<PhotographPose> photographs;
};

// A dataset, or a part of one.
struct SampleRequest {
  std::vector<std::string> objects;  // names
  // What a dataset contains, but for its objects, the model's default and the renderer.
  dataset::DatasetSpecification specification;
  dataset::DatasetPart part;
  std::string session;         // that a physical source journals in; empty: "default"
  dataset::StreamShare share;  // whose stream it is
  std::string key;  // of what decides the touches: a physical source journals sample i under it and i
};

// What a stream of samples contains.
struct SampleHeader {
  uint64_t samples = 0;                       // in the whole dataset
  std::shared_ptr<const model::Model> model;  // that simulates; null: none
  std::vector<std::string> mesh_hashes;
  int fingers = 0;
  double spacing_m = 0;
  std::vector<dataset::ColumnInfo> columns;
  std::string renderer;  // "egl" or "cpu"; empty: none
};

// The header of a dataset's stream; the model and the renderer are for those who have one to add.
SampleHeader HeaderOf(const dataset::DatasetSpecification& specification, int fingers, double spacing_m);

// The batches of a dataset, in order. Not for several threads.
class SampleStream {
 public:
  virtual ~SampleStream() = default;
  virtual const SampleHeader& header() const = 0;
  // Nothing at the end. The guard is asked at least once per batch.
  virtual absl::StatusOr<std::optional<dataset::DatasetBatch>> Next(const MotionGuard& guard) = 0;
};

class Source {
 public:
  // `objects` must outlive the source.
  Source(const ObjectStore* objects, const SourceLimits& limits) : objects_(*objects), limits_(limits) {}
  virtual ~Source() = default;

  const ObjectStore& objects() const { return objects_; }
  const SourceLimits& limits() const { return limits_; }
  virtual SourceInfo Describe() const = 0;
  // Every touch of a generator is drawn until all fingers complete it (touch/draw_check.h). FAILED_PRECONDITION: no
  // draw does; says which condition failed how often. The guard is asked once per touch.
  absl::StatusOr<ExpandedPlan> ExpandPlan(const PlanRequest& request, const MotionGuard& guard) const;

  // Each checks its request against the limits and the objects before anything is computed or moved: INVALID_ARGUMENT
  // or NOT_FOUND names the field. Beside that, errors are those of the guard and of the source.
  absl::StatusOr<TouchResults> Touch(const TouchRequest& request, const MotionGuard& guard);
  absl::StatusOr<CaptureResults> Capture(const CaptureRequest& request, const MotionGuard& guard);
  // The stream may outlive the request, not the source.
  absl::StatusOr<std::unique_ptr<SampleStream>> Stream(const SampleRequest& request);

 protected:
  // The nominal rig behind plans: its fingers, and the effects of a source that simulates. Never null.
  virtual std::shared_ptr<const model::Model> OwnModel() const = 0;
  // With requests that are checked.
  virtual absl::StatusOr<TouchResults> MakeTouches(const TouchRequest& request, const ServedObject& object,
                                                   const MotionGuard& guard) = 0;
  // Takes the pictures one after the other; take(picture, pose) appends one to the results, a virtual source's with null.
  using TakePicture = std::function<absl::Status(const image::Image& picture, const PhotographPose* pose)>;
  virtual absl::Status MakePictures(const CaptureRequest& request, const ServedObject& object,
                                    const MotionGuard& guard, const TakePicture& take) = 0;
  // specification.objects are filled in.
  virtual absl::StatusOr<std::unique_ptr<SampleStream>> MakeStream(const SampleRequest& request) = 0;

 private:
  const ObjectStore& objects_;
  const SourceLimits limits_;
};

}  // namespace touchstone::source
