// Describe, objects, plans, touches and photographs.
#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "tests/conformance/conformance.h"

namespace touchstone {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class SourceConformance : public Conformance {
 protected:
  grpc::Status Touch(const v1::TouchRequest& request, v1::TouchResponse* response) const {
    grpc::ClientContext context;
    return source_->Touch(&context, request, response);
  }
  v1::TouchRequest OneTouch() {
    v1::TouchRequest request;
    request.set_lease_token(LeaseToken());
    const v1::Object object = AnObject();
    request.set_object(object.name());
    *request.add_touches() = TouchFromAbove(object);
    return request;
  }
};

TEST_F(SourceConformance, DescribesItsKindVersionPlansAndLimits) {
  EXPECT_THAT(description_.kind(), testing::AnyOf(v1::SOURCE_KIND_VIRTUAL, v1::SOURCE_KIND_PHYSICAL));
  EXPECT_FALSE(description_.version().empty());
  EXPECT_GT(description_.plans_size(), 0);
  EXPECT_GT(description_.max_touches_per_request(), 0u);
  EXPECT_GT(description_.max_batch_size(), 0u);
  EXPECT_GE(description_.max_fingers(), 3u);
}

TEST_F(SourceConformance, ObjectsHaveNamesBoundsAndHashes) {
  const v1::Object object = AnObject();
  EXPECT_FALSE(object.name().empty());
  EXPECT_LT(object.bounds_min_m().x(), object.bounds_max_m().x());
  EXPECT_EQ(object.mesh_hash().size(), 64u);
}

TEST_F(SourceConformance, ATouchGivesOneTimeAFingerRelativeToTheFirst) {
  v1::TouchResponse response;
  const grpc::Status status = Touch(OneTouch(), &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(response.results_size(), 1);
  const v1::TouchResult& result = response.results(0);
  ASSERT_EQ(result.descriptor_s_size(), 3);
  ASSERT_EQ(result.contact_time_s_size(), 3);
  EXPECT_TRUE(result.complete());
  const double first_s = *std::min_element(result.contact_time_s().begin(), result.contact_time_s().end());
  EXPECT_GT(first_s, 0);
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_NEAR(result.descriptor_s(finger), result.contact_time_s(finger) - first_s, 1e-9);
}

TEST_F(SourceConformance, AFingerThatMeetsNothingIsReportedAndTheOthersStand) {
  v1::TouchRequest request = OneTouch();
  v1::Vector3* target = request.mutable_touches(0)->mutable_target_m();
  const v1::Object object = AnObject();
  target->set_x(object.bounds_max_m().x() - 0.02);  // the last finger, 30 mm further out, passes the object
  target->set_z(object.bounds_max_m().z());
  request.mutable_touches(0)->set_stroke_m(0.1);
  v1::TouchResponse response;
  const grpc::Status status = Touch(request, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_FALSE(response.results(0).complete());
  EXPECT_FALSE(std::isnan(response.results(0).descriptor_s(0)));
  EXPECT_TRUE(std::isnan(response.results(0).descriptor_s(2)));
}

TEST_F(SourceConformance, RepeatsOfATouchAgreeWithinNoiseAndExactlyWhereItIsVirtual) {
  v1::TouchRequest request = OneTouch();
  *request.add_touches() = request.touches(0);
  v1::TouchResponse first, second;
  ASSERT_TRUE(Touch(request, &first).ok());
  ASSERT_TRUE(Touch(request, &second).ok());
  for (int finger = 0; finger < 3; ++finger) {
    EXPECT_NEAR(first.results(0).descriptor_s(finger), first.results(1).descriptor_s(finger), 0.1);
    if (IsVirtual()) {
      EXPECT_EQ(first.results(0).descriptor_s(finger), second.results(0).descriptor_s(finger));
    }
  }
}

// Every mistake: what is wrong with the request, the code, and words that the message must have.
struct Mistake {
  const char* name;
  std::function<void(v1::TouchRequest*)> make;
  grpc::StatusCode code;
  const char* field;
  const char* hint;
};

TEST_F(SourceConformance, MistakesAreRefusedWithFieldValueAndWhatWouldBeRight) {
  const std::vector<Mistake> mistakes = {
      {"unknown object", [](auto* r) { r->set_object("no-such-object"); }, grpc::NOT_FOUND, "object",
       "no-such-object"},
      {"no touches", [](auto* r) { r->clear_touches(); }, grpc::INVALID_ARGUMENT, "touches", "at least one"},
      {"zero approach", [](auto* r) { r->mutable_touches(0)->mutable_approach()->set_z(0); },
       grpc::INVALID_ARGUMENT, "touches[0].approach", "unit vector"},
      {"oblique lateral", [](auto* r) { r->mutable_touches(0)->mutable_lateral()->set_z(0.04); },
       grpc::INVALID_ARGUMENT, "touches[0].lateral", "perpendicular"},
      {"NaN target", [](auto* r) { r->mutable_touches(0)->mutable_target_m()->set_y(NAN); },
       grpc::INVALID_ARGUMENT, "touches[0].target_m", "finite"},
      {"infinite standoff", [](auto* r) { r->mutable_touches(0)->set_standoff_m(INFINITY); },
       grpc::INVALID_ARGUMENT, "touches[0].standoff_m", "inf"},
      {"no speed", [](auto* r) { r->mutable_touches(0)->set_speed_m_s(0); }, grpc::INVALID_ARGUMENT,
       "touches[0].speed_m_s", "above 0"},
      {"no target", [](auto* r) { r->mutable_touches(0)->clear_target_m(); }, grpc::INVALID_ARGUMENT,
       "touches[0].target_m", "missing"},
  };
  for (const Mistake& mistake : mistakes) {
    v1::TouchRequest request = OneTouch();
    mistake.make(&request);
    v1::TouchResponse response;
    const grpc::Status status = Touch(request, &response);
    EXPECT_EQ(status.error_code(), mistake.code) << mistake.name << ": " << status.error_message();
    EXPECT_THAT(status.error_message(), AllOf(HasSubstr(mistake.field), HasSubstr(mistake.hint)))
        << mistake.name;
  }
}

TEST_F(SourceConformance, ATouchThatIsAskedForAgainUnderItsIdIsTheSame) {
  v1::TouchRequest request = OneTouch();
  *request.add_touches() = request.touches(0);
  request.set_session("conformance");
  request.add_touch_ids("first");
  v1::TouchResponse first, second;
  const grpc::Status refused = Touch(request, &first);
  EXPECT_EQ(refused.error_code(), grpc::INVALID_ARGUMENT) << "one id for two touches";
  EXPECT_THAT(refused.error_message(), HasSubstr("touch_ids"));
  request.add_touch_ids("second");
  ASSERT_TRUE(Touch(request, &first).ok());
  ASSERT_TRUE(Touch(request, &second).ok());
  for (int touch = 0; touch < 2; ++touch)
    for (int finger = 0; finger < 3; ++finger)
      EXPECT_EQ(first.results(touch).descriptor_s(finger), second.results(touch).descriptor_s(finger));
}

TEST_F(SourceConformance, AlmostPerpendicularVectorsAreMadeExact) {
  v1::TouchRequest request = OneTouch();
  request.mutable_touches(0)->mutable_lateral()->set_z(0.0005);
  v1::TouchResponse response;
  EXPECT_TRUE(Touch(request, &response).ok());
}

TEST_F(SourceConformance, PlansExpandToValidTouches) {
  for (const std::string& name : description_.plans()) {
    if (name == "list") continue;
    v1::ExpandPlanRequest request;
    request.set_object(AnObject().name());
    request.set_count(5);
    name == "sphere" ? (void)request.mutable_plan()->mutable_sphere()
                     : (void)request.mutable_plan()->mutable_faces();
    v1::ExpandPlanResponse response;
    grpc::ClientContext context;
    ASSERT_TRUE(source_->ExpandPlan(&context, request, &response).ok());
    EXPECT_EQ(response.touches_size(), 5);
    EXPECT_GT(response.touches(0).standoff_m(), 0);
    EXPECT_GT(response.touches(0).speed_m_s(), 0);
  }
}

TEST_F(SourceConformance, PhotographsHaveTheSizeAskedFor) {
  if (description_.max_images_per_request() == 0) GTEST_SKIP() << "this source has no camera";
  v1::CaptureRequest request;
  request.set_lease_token(LeaseToken());
  const v1::Object object = AnObject();
  request.set_object(object.name());
  *request.add_views()->mutable_touch() = TouchFromAbove(object);
  request.mutable_image()->set_width(64);
  request.mutable_image()->set_height(48);
  v1::CaptureResponse response;
  grpc::ClientContext context;
  const grpc::Status status = source_->Capture(&context, request, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.rows(), 1u);
  EXPECT_EQ(response.columns(0).name(), "image");
  EXPECT_EQ(response.columns(0).data().size(), 64u * 48u);
}

TEST_F(SourceConformance, ImageSizesOutOfRangeAreRefused) {
  if (description_.max_images_per_request() == 0) GTEST_SKIP() << "this source has no camera";
  v1::CaptureRequest request;
  request.set_lease_token(LeaseToken());
  const v1::Object object = AnObject();
  request.set_object(object.name());
  *request.add_views()->mutable_touch() = TouchFromAbove(object);
  request.mutable_image()->set_width(20000);
  v1::CaptureResponse response;
  grpc::ClientContext context;
  const grpc::Status status = source_->Capture(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), AllOf(HasSubstr("width"), HasSubstr("20000"), HasSubstr("2048")));
}

TEST_F(SourceConformance, AnExpiredDeadlineIsKept) {
  v1::TouchRequest request = OneTouch();
  for (int k = 0; k < 20; ++k) *request.add_touches() = request.touches(0);
  v1::TouchResponse response;
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() - std::chrono::seconds(1));
  EXPECT_EQ(source_->Touch(&context, request, &response).error_code(), grpc::DEADLINE_EXCEEDED);
}

}  // namespace
}  // namespace touchstone
