// Leases, stop and state, and the standard services.
#include <gmock/gmock.h>

#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/conformance/conformance.h"

namespace touchstone {
namespace {

class ControlConformance : public Conformance {
 protected:
  grpc::Status Acquire(const std::string& holder, bool take, v1::Lease* lease) const {
    v1::AcquireLeaseRequest request;
    request.set_holder(holder);
    request.set_take(take);
    grpc::ClientContext context;
    return control_->AcquireLease(&context, request, lease);
  }
  grpc::Status Renew(const v1::Lease& lease) const {
    v1::RenewLeaseRequest request;
    request.set_token(lease.token());
    v1::Lease renewed;
    grpc::ClientContext context;
    return control_->RenewLease(&context, request, &renewed);
  }
  grpc::Status Release(const v1::Lease& lease) const {
    v1::ReleaseLeaseRequest request;
    request.set_token(lease.token());
    v1::ReleaseLeaseResponse response;
    grpc::ClientContext context;
    return control_->ReleaseLease(&context, request, &response);
  }
};

TEST_F(ControlConformance, OneWriterHoldsTheLeaseUntilItReleasesIt) {
  v1::Lease first, second;
  ASSERT_TRUE(Acquire("first", true, &first).ok());
  EXPECT_GT(first.window_s(), 0);
  const grpc::Status refused = Acquire("second", false, &second);
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(refused.error_message(), testing::HasSubstr("first"));
  EXPECT_TRUE(Renew(first).ok());
  EXPECT_TRUE(Release(first).ok());
  EXPECT_TRUE(Acquire("second", false, &second).ok());
  EXPECT_GT(second.epoch(), first.epoch());
  EXPECT_TRUE(Release(second).ok());
}

TEST_F(ControlConformance, AStaleWriterIsRefusedAndItsTouchIsNotMade) {
  v1::Lease stale, fresh;
  ASSERT_TRUE(Acquire("stale", true, &stale).ok());
  ASSERT_TRUE(Acquire("fresh", true, &fresh).ok());
  EXPECT_EQ(Renew(stale).error_code(), grpc::ABORTED);
  v1::TouchRequest request;
  const v1::Object object = AnObject();
  request.set_object(object.name());
  *request.add_touches() = TouchFromAbove(object);
  request.set_lease_token(stale.token());
  v1::TouchResponse response;
  grpc::ClientContext context;
  EXPECT_EQ(source_->Touch(&context, request, &response).error_code(), grpc::ABORTED);
  EXPECT_TRUE(Release(fresh).ok());
}

TEST_F(ControlConformance, ALeaseThatIsNotRenewedIsLost) {
  v1::Lease lease, next;
  ASSERT_TRUE(Acquire("silent", true, &lease).ok());
  if (clock() == nullptr && lease.window_s() > 5)
    GTEST_SKIP() << "the window of " << lease.window_s() << " s is too long to wait for";
  if (clock() != nullptr) {
    clock()->Advance(0.99 * lease.window_s());
    EXPECT_EQ(Acquire("next", false, &next).error_code(), grpc::FAILED_PRECONDITION);
    clock()->Advance(0.02 * lease.window_s());
  } else {
    SteadyClock().SleepFor(lease.window_s());
  }
  const grpc::Status status = Acquire("next", false, &next);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(Renew(lease).error_code(), grpc::ABORTED);
  Release(next);
}

TEST_F(ControlConformance, StopNeedsNoLease) {
  v1::StopRequest request;
  request.set_reason("conformance test");
  v1::StopResponse response;
  grpc::ClientContext context;
  EXPECT_TRUE(control_->Stop(&context, request, &response).ok());
  // It is released only by somebody who says who and why.
  v1::State state;
  v1::ResetRequest reset;
  grpc::ClientContext unnamed, named;
  EXPECT_EQ(control_->Reset(&unnamed, reset, &state).error_code(), grpc::INVALID_ARGUMENT);
  reset.set_holder("ana@bench2");
  reset.set_reason("conformance test");
  const grpc::Status released = control_->Reset(&named, reset, &state);
  EXPECT_TRUE(released.ok()) << released.error_message();
  EXPECT_NE(state.state(), v1::SOURCE_STATE_STOPPED);
  EXPECT_EQ(state.stop_reason(), "");
}

TEST_F(ControlConformance, StateTellsWhoHoldsTheLease) {
  v1::Lease lease;
  ASSERT_TRUE(Acquire("ana@bench2", true, &lease).ok());
  v1::State state;
  grpc::ClientContext context;
  ASSERT_TRUE(control_->GetState(&context, {}, &state).ok());
  EXPECT_EQ(state.lease_holder(), "ana@bench2");
  EXPECT_NE(state.state(), v1::SOURCE_STATE_UNSPECIFIED);
  Release(lease);
}

TEST_F(ControlConformance, HealthIsServingForTheProcessAndForEachService) {
  const auto health = grpc::health::v1::Health::NewStub(channel_);
  for (const char* service : {"", "touchstone.v1.Source", "touchstone.v1.Control"}) {
    grpc::health::v1::HealthCheckRequest request;
    request.set_service(service);
    grpc::health::v1::HealthCheckResponse response;
    grpc::ClientContext context;
    ASSERT_TRUE(health->Check(&context, request, &response).ok()) << service;
    EXPECT_EQ(response.status(), grpc::health::v1::HealthCheckResponse::SERVING) << service;
  }
}

}  // namespace
}  // namespace touchstone
