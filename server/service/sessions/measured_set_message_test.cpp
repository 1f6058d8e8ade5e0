#include "server/service/sessions/measured_set_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace touchstone::service {
namespace {

using testing::HasSubstr;

constexpr char kCsv[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,session_time_s,round,face,cov_temperature\n"
    "7,lat20,20.1,60,-12.3,0.1,7,0,0,-1,1,0,0,1250000.0625,,1250002.5,3.5,0,1,21.25\n"
    "3,cup,10,60,0,0,0,0,0,-1,1,0,0,3000000,3000100,3000200.125,9.25,1,0,\n";

TEST(MeasuredSetMessage, ASetComesBackAsItWas) {
  const auto set = session::ParseMeasurementSet(kCsv, "s");
  ASSERT_TRUE(set.ok()) << set.status();
  const auto back = FromProto(ToProto(*set), "s");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->objects, set->objects);
  EXPECT_EQ(back->touch, set->touch);
  EXPECT_EQ(back->object, set->object);
  EXPECT_EQ(back->target_m, set->target_m);
  EXPECT_EQ(back->approach, set->approach);
  EXPECT_EQ(back->lateral, set->lateral);
  EXPECT_EQ(back->standoff_m, set->standoff_m);
  EXPECT_EQ(back->speed_m_s, set->speed_m_s);
  EXPECT_EQ(back->session_time_s, set->session_time_s);
  EXPECT_EQ(back->has_session_time, set->has_session_time);
  EXPECT_EQ(back->round, set->round);
  EXPECT_EQ(back->face, set->face);
  EXPECT_EQ(back->line, set->line);
  ASSERT_EQ(back->time_s.size(), set->time_s.size());
  EXPECT_TRUE(std::isnan(back->TimeS(0, 1)));
  EXPECT_EQ(back->TimeS(0, 0), set->TimeS(0, 0));
  EXPECT_EQ(back->covariates.at("cov_temperature")[0], 21.25);
  EXPECT_TRUE(std::isnan(back->covariates.at("cov_temperature")[1]));
}

TEST(MeasuredSetMessage, RefusesWhatNoFileCouldHold) {
  const v1::MeasuredSet good = ToProto(*session::ParseMeasurementSet(kCsv, "s"));
  const auto refusal = [&](const std::function<void(v1::MeasuredSet*)>& change) {
    v1::MeasuredSet bad = good;
    change(&bad);
    const auto set = FromProto(bad, "s");
    EXPECT_EQ(set.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(set.status().message());
  };
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->Clear(); }), HasSubstr("set.fingers = 0"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->set_fingers(17); }), HasSubstr("of one length"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->add_touch(9); }), HasSubstr("of one length"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->mutable_target_m()->RemoveLast(); }),
              HasSubstr("of one length"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->set_object(0, 2); }), HasSubstr("object (-1)"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->set_approach(2, -2); }),
              HasSubstr("the length of approach (2)"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->set_target_m(0, NAN); }), HasSubstr("target_m"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { set->set_contact_time_s(0, INFINITY); }),
              HasSubstr("a contact time"));
  EXPECT_THAT(refusal([](v1::MeasuredSet* set) { (*set->mutable_covariates())["warm"]; }),
              HasSubstr("names begin with 'cov_'"));
}

}  // namespace
}  // namespace touchstone::service
