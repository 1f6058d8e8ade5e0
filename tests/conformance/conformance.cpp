#include "tests/conformance/conformance.h"

namespace touchstone {
namespace {

std::string& Target() {
  static std::string target;
  return target;
}

ManualClock*& TargetsClock() {
  static ManualClock* clock = nullptr;
  return clock;
}

}  // namespace

void SetConformanceTarget(const std::string& address, ManualClock* clock) {
  Target() = address;
  TargetsClock() = clock;
}

ManualClock* Conformance::clock() {
  return TargetsClock();
}

Conformance::Conformance() {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(256 << 20);
  channel_ = grpc::CreateCustomChannel(Target(), grpc::InsecureChannelCredentials(), arguments);
  source_ = v1::Source::NewStub(channel_);
  control_ = v1::Control::NewStub(channel_);
  grpc::ClientContext context;
  const grpc::Status status = source_->Describe(&context, {}, &description_);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

Conformance::~Conformance() {
  ending_ = true;
  if (!keeper_.joinable()) return;
  keeper_.join();
  v1::ReleaseLeaseRequest request;
  request.set_token(lease_.token());
  v1::ReleaseLeaseResponse response;
  grpc::ClientContext context;
  control_->ReleaseLease(&context, request, &response);  // another test may have taken it
}

std::string Conformance::LeaseToken() {
  if (!description_.lease_required()) return "";
  if (!lease_.token().empty()) return lease_.token();
  v1::AcquireLeaseRequest request;
  request.set_holder("conformance test");
  request.set_take(true);
  grpc::ClientContext context;
  const grpc::Status status = control_->AcquireLease(&context, request, &lease_);
  EXPECT_TRUE(status.ok()) << status.error_message();
  keeper_ = std::thread([this] {
    v1::RenewLeaseRequest renew;
    renew.set_token(lease_.token());
    while (!ending_) {
      v1::Lease renewed;
      grpc::ClientContext renewing;
      if (!control_->RenewLease(&renewing, renew, &renewed).ok()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  });
  return lease_.token();
}

v1::Object Conformance::AnObject() const {
  grpc::ClientContext context;
  v1::ListObjectsResponse response;
  EXPECT_TRUE(source_->ListObjects(&context, {}, &response).ok());
  EXPECT_GT(response.objects_size(), 0);
  return response.objects(0);
}

v1::CommandedTouch Conformance::TouchFromAbove(const v1::Object& object) const {
  v1::CommandedTouch touch;
  touch.mutable_target_m()->set_x(0.5 * (object.bounds_min_m().x() + object.bounds_max_m().x()));
  touch.mutable_target_m()->set_y(0.5 * (object.bounds_min_m().y() + object.bounds_max_m().y()));
  touch.mutable_target_m()->set_z(object.bounds_max_m().z());
  touch.mutable_approach()->set_z(-1);
  touch.mutable_lateral()->set_x(1);
  touch.set_standoff_m(0.05);
  touch.set_speed_m_s(0.02);
  return touch;
}

v1::DatasetSpec Conformance::SmallDataset(uint64_t samples) const {
  v1::DatasetSpec spec;
  spec.add_objects(AnObject().name());
  spec.mutable_plan()->mutable_faces()->set_samples_per_face(2);
  spec.mutable_plan()->mutable_faces()->set_rounds(1000);
  spec.set_samples(samples);
  spec.set_seed(11);
  for (const char* column : {"index", "object", "descriptor", "pose"}) spec.add_columns(column);
  return spec;
}

Conformance::Streamed Conformance::Stream(v1::StreamDatasetRequest request) {
  request.set_lease_token(LeaseToken());
  Streamed streamed;
  grpc::ClientContext context;
  const auto reader = source_->StreamDataset(&context, request);
  v1::StreamDatasetResponse response;
  while (reader->Read(&response)) {
    if (response.has_header()) streamed.header = response.header();
    if (response.has_batch()) streamed.batches.push_back(response.batch());
  }
  streamed.status = reader->Finish();
  return streamed;
}

std::string ColumnBytes(const std::vector<v1::Batch>& batches, const std::string& column) {
  std::string bytes;
  for (const v1::Batch& batch : batches)
    for (const v1::Column& c : batch.columns())
      if (c.name() == column) bytes += c.data();
  return bytes;
}

}  // namespace touchstone
