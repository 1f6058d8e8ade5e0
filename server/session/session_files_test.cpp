#include "server/session/session_files.h"
#include "server/session/recorded/touch_series.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>

#include "server/base/files/file_writer.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/emulated.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/session_measurements.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;

const char kCsvOfSessionFiles[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,session_time_s,round,face,cov_temperature\n"
    "7,lat20,20.1,60,-12.3,0.1,7,0,0,-1,1,0,0,1250000.0625,,1250002.5,3.5,0,1,21.25\n"
    "3,cup,10,60,0,0,0,0,0,-1,1,0,0,3000000,3000100,3000200.125,9.25,1,0,\n"
    "12,lat20,20.1,60,-12.3,0.1,7,0,0,-1,1,0,0,1250001,1250002,1250003,15,1,1,21.5\n";

class SessionFiles : public ::testing::Test {
 protected:
  SessionFiles() {
    journal_ = *Journal::Open(folder_ + "/session.db", Journal::Mode::kCreateOrReadWrite);
    csv_ = folder_ + "/set.csv";
    options_.session = "s";
  }
  void Import(const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(csv_, text).ok());
    const absl::Status imported = Add(ReadSessionCsv(csv_, options_));
    ASSERT_TRUE(imported.ok()) << imported;
  }

  absl::Status Add(const absl::StatusOr<SessionContent>& content) {
    return content.ok() ? journal_->AddSession(*content) : content.status();
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::string csv_;
  std::unique_ptr<Journal> journal_;
  ImportOptions options_;
};

TEST_F(SessionFiles, AMeasurementFileComesBackAsItWas) {
  Import(kCsvOfSessionFiles);
  const std::string out = folder_ + "/out.csv";
  ASSERT_TRUE(ExportSessionCsv(*journal_, "s", out).ok());
  EXPECT_EQ(*ReadFile(out), kCsvOfSessionFiles);
  const auto session = journal_->Session("s");
  EXPECT_EQ(session->done, 3u);
  EXPECT_EQ(session->fingers, 3);
  EXPECT_THAT(session->provenance, HasSubstr("imported from " + csv_));
}

TEST_F(SessionFiles, WhatIsExportedStandsInTheOrderOfTheApproaches) {
  JournalSession session;
  session.name = "rig";
  session.fingers = 1;
  ASSERT_TRUE(journal_->EnsureSession(session).ok());
  v1::CommandedTouch command;
  command.mutable_target_m();
  command.mutable_approach()->set_z(-1);
  command.mutable_lateral()->set_x(1);
  command.set_speed_m_s(0.02);
  const auto begin = [&](const char* id) {
    ASSERT_TRUE(journal_->Begin("rig", id, "cup", "+z", CommandBytes(command)).ok());
    ASSERT_TRUE(journal_->Executing("rig", id, 1, 1).ok());
  };
  JournalResult result;
  result.fingers.resize(1);
  begin("first");
  ASSERT_TRUE(journal_->Failed("rig", "first", "why").ok());
  begin("second");
  result.fingers[0].contact_time_s = 2;
  result.session_time_s = 20;
  ASSERT_TRUE(journal_->Done("rig", "second", result).ok());
  begin("first");
  result.fingers[0].contact_time_s = 3;
  result.session_time_s = 30;
  ASSERT_TRUE(journal_->Done("rig", "first", result).ok());
  begin("never");
  const auto touches = SessionMeasurements(*journal_, "rig");
  ASSERT_TRUE(touches.ok()) << touches.status();
  ASSERT_EQ(touches->size(), 2u);
  EXPECT_EQ((*touches)[0].time_s[0], 2);
  EXPECT_EQ((*touches)[1].time_s[0], 3);
  EXPECT_EQ((*touches)[1].commanded.session_time_s(), 30);
  // The ids are no numbers: the session's are taken.
  EXPECT_EQ((*touches)[0].touch, 1u);
  EXPECT_EQ((*touches)[1].touch, 2u);
}

TEST_F(SessionFiles, AnEmulatorsMarkGoesAlongIntoEveryFileAndBack) {
  Import(kCsvOfSessionFiles);
  EXPECT_FALSE(journal_->Session("s")->emulated);
  SessionContent content = *ReadSessionCsv(csv_, options_);
  content.session.name = "emulated";
  content.session.emulated = true;
  ASSERT_TRUE(journal_->AddSession(content).ok());
  EXPECT_TRUE(journal_->Session("emulated")->emulated);
  const auto set = SessionMeasurementSet(*journal_, "emulated", "emulated");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(CountEmulated(*set), 3);
  EXPECT_EQ(CountEmulated(*SessionMeasurementSet(*journal_, "s", "s")), 0);
  const std::string csv = folder_ + "/emulated.csv", h5 = folder_ + "/emulated.h5";
  ASSERT_TRUE(ExportSessionCsv(*journal_, "emulated", csv).ok());
  EXPECT_TRUE(ReadSessionCsv(csv, options_)->session.emulated);
  ASSERT_TRUE(ExportSessionHdf5(*journal_, "emulated", h5).ok());
  EXPECT_TRUE(ReadSessionHdf5(h5, options_)->session.emulated);
}

TEST_F(SessionFiles, OfAPlanFromAnEmulatedSessionTheSessionSaysWhetherItIs) {
  std::string text = kCsvOfSessionFiles;
  text.insert(text.find('\n'), ",cov_emulated");
  for (size_t at = text.find('\n', text.find('\n') + 1); at != std::string::npos;
       at = text.find('\n', at + 3))
    text.insert(at, ",1");
  ASSERT_TRUE(WriteFileAtomically(csv_, text).ok());
  auto content = ReadSessionCsv(csv_, options_);
  ASSERT_TRUE(content.ok()) << content.status();
  EXPECT_TRUE(content->session.emulated);
  content->session.emulated = false;  // made again, on a real rig
  ASSERT_TRUE(journal_->AddSession(*content).ok());
  EXPECT_EQ(CountEmulated(*SessionMeasurementSet(*journal_, "s", "s")), 0);
}

// Every column, NaN where NaN is; numbers within the relative `tolerance`.
void ExpectSame(const MeasurementSet& a, const MeasurementSet& b, double tolerance) {
  const auto near = [&](double p, double q) {
    return std::abs(p - q) <= tolerance * std::abs(p) || p == q || (std::isnan(p) && std::isnan(q));
  };
  const auto same = [&](const std::vector<double>& x, const std::vector<double>& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), near);
  };
  const auto same_vectors = [&](const std::vector<Eigen::Vector3d>& x,
                                const std::vector<Eigen::Vector3d>& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), [&](const auto& p, const auto& q) {
      return near(p.x(), q.x()) && near(p.y(), q.y()) && near(p.z(), q.z());
    });
  };
  EXPECT_EQ(a.origin, b.origin);
  EXPECT_EQ(a.fingers, b.fingers);
  EXPECT_EQ(a.has_poses, b.has_poses);
  EXPECT_EQ(a.has_session_time, b.has_session_time);
  EXPECT_EQ(a.objects, b.objects);
  EXPECT_EQ(a.touch, b.touch);
  EXPECT_EQ(a.object, b.object);
  EXPECT_TRUE(same_vectors(a.target_m, b.target_m));
  EXPECT_TRUE(same_vectors(a.approach, b.approach));
  EXPECT_TRUE(same_vectors(a.lateral, b.lateral));
  EXPECT_TRUE(same(a.standoff_m, b.standoff_m));
  EXPECT_TRUE(same(a.speed_m_s, b.speed_m_s));
  EXPECT_TRUE(same(a.session_time_s, b.session_time_s));
  EXPECT_EQ(a.round, b.round);
  EXPECT_EQ(a.face, b.face);
  EXPECT_EQ(a.line, b.line);
  EXPECT_TRUE(same(a.time_s, b.time_s));
  ASSERT_EQ(a.covariates.size(), b.covariates.size());
  for (const auto& [name, values] : a.covariates)
    EXPECT_TRUE(b.covariates.count(name) == 1 && same(values, b.covariates.at(name))) << name;
}

TEST_F(SessionFiles, ASessionIsTheSetThatItsFileIsReadAs) {
  Import(kCsvOfSessionFiles);
  const auto file = ParseMeasurementSet(kCsvOfSessionFiles, "s");
  const auto direct = SessionMeasurementSet(*journal_, "s", "s");
  ASSERT_TRUE(file.ok() && direct.ok()) << direct.status();
  ExpectSame(*direct, *file, 0);
}

TEST_F(SessionFiles, WhatARigMeasuredIsTheSetThatItsFileIsReadAs) {
  JournalSession session;
  session.name = "rig";
  ASSERT_TRUE(journal_->EnsureSession(session).ok());
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<JournalTouch> touches(200);
  for (size_t k = 0; k < touches.size(); ++k) {
    touch::CommandedTouch commanded;  // numbers that no decimal of few digits is
    commanded.target_m = {0.1 * uniform(random), 0.1 * uniform(random), 0.1 * uniform(random)};
    commanded.approach = Eigen::Vector3d(uniform(random), uniform(random), uniform(random)).normalized();
    commanded.lateral = commanded.approach.unitOrthogonal();
    commanded.standoff_m = 0.05 + 0.01 * uniform(random);
    commanded.speed_m_s = 0.02 + 0.01 * uniform(random);
    if (k % 3 == 0) commanded.covariates["cov_temperature"] = 20 + uniform(random);
    JournalTouch& touch = touches[k];
    touch.id = "touch-" + std::to_string(k);
    touch.object = k % 2 == 0 ? "cup" : "lat20";
    touch.command = CommandBytes(commanded);
    touch.stage = TouchStage::kDone;
    touch.result.session_time_s = 8.1 * k + uniform(random) + 1;
    for (int finger = 0; finger < 3; ++finger) {
      JournalFinger& reported = touch.result.fingers.emplace_back();
      reported.contact_time_s = finger == 1 && k % 7 == 0 ? std::nan("") : 2 + uniform(random);
    }
  }
  ASSERT_TRUE(journal_->AddFinished("rig", touches).ok());
  const std::string out = folder_ + "/rig.csv";
  ASSERT_TRUE(ExportSessionCsv(*journal_, "rig", out).ok());
  const auto file = ParseMeasurementSet(*ReadFile(out), "rig");
  const auto direct = SessionMeasurementSet(*journal_, "rig", "rig");
  ASSERT_TRUE(file.ok() && direct.ok()) << file.status() << direct.status();
  // The file's millimetres and microseconds are rounded.
  ExpectSame(*direct, *file, 4 * std::numeric_limits<double>::epsilon());
}

TEST_F(SessionFiles, ASetIsRefusedWhereItsFileWouldBe) {
  const auto touches = ParseMeasurements(kCsvOfSessionFiles, "s");
  ASSERT_TRUE(touches.ok());
  const auto refusal = [&](const std::function<void(MeasuredTouch*)>& change) {
    std::vector<MeasuredTouch> changed = *touches;
    change(&changed[1]);
    return std::string(MakeMeasurementSet(changed, "s").status().message());
  };
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->time_s[0] = -1; }),
              HasSubstr("s:3: touch 3: a contact time (-1)"));
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->touch = 7; }), HasSubstr("stands on line 2 already"));
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->commanded.set_speed_m_s(0); }),
              HasSubstr("speed_m_s (0) is out of range"));
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->commanded.mutable_lateral()->set_z(0.5); }),
              HasSubstr("the length of lateral"));
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->object.clear(); }), HasSubstr("an object's name"));
  EXPECT_THAT(refusal([](MeasuredTouch* touch) { touch->time_s.pop_back(); }), HasSubstr("has 2 fingers"));
}

TEST_F(SessionFiles, ImportsAreWholeOrAbsent) {
  Import(kCsvOfSessionFiles);
  EXPECT_TRUE(absl::IsAlreadyExists(Add(ReadSessionCsv(csv_, options_))));
  options_.session = "t";
  const std::string plan = folder_ + "/plan.csv";
  const std::string text = kCsvOfSessionFiles;
  ASSERT_TRUE(WriteFileAtomically(plan,
                                  "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,"
                                  "approach_x,approach_y,approach_z,lateral_x,lateral_y,lateral_z\n"
                                  "0,cup,20,60,0,0,0,0,0,-1,1,0,0\n")
                  .ok());
  const absl::Status status = Add(ReadSessionCsv(plan, options_));
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(std::string(status.message()), HasSubstr("it is a plan"));
  EXPECT_FALSE(Add(ReadSessionCsv(folder_ + "/no.csv", options_)).ok());
  EXPECT_TRUE(absl::IsNotFound(journal_->Session("t").status()));
}

TEST_F(SessionFiles, AnHdf5FileComesBackAsTheSessionThatItWas) {
  Import(kCsvOfSessionFiles);
  std::vector<JournalTouch> more(1);
  more[0].id = "with poses";
  more[0].object = "cup";
  more[0].up_face = "-x";
  touch::CommandedTouch commanded;
  commanded.target_m = {0.01, 1.0 / 3, -0.1};
  commanded.approach = {0, 0, -1};
  commanded.lateral = {1, 0, 0};
  commanded.standoff_m = 0.06;
  commanded.speed_m_s = 0.1 / 3;
  more[0].command = CommandBytes(commanded);
  more[0].stage = TouchStage::kDone;
  more[0].attempt = 3;
  JournalResult& result = more[0].result;
  result.recovered = true;
  result.speed_m_s = 0.1 / 3;
  result.start_unix_s = 1.7e9 + 1.0 / 3;
  result.effector_drift = 1e-4 / 3;
  for (int i = 0; i < 3; ++i)
    result.fingers.push_back({1.0 / 3 + i, {0.1, 0.2, 0.3, 1, 2, i / 7.0}, (uint64_t{1} << 63) + i});
  v1::TouchSeries states;
  for (int k = 0; k < 4; ++k) {
    states.add_time_s(k / 3.0);
    for (int i = 0; i < 6; ++i) states.add_joints_rad(k + i / 7.0);
    for (int i = 0; i < 6; ++i) states.add_base_from_tip(k - i / 7.0);
    for (int i = 0; i < 3; ++i) states.add_tip_force_n(10 * k + i / 7.0);
  }
  const JournalSeries series{kSeriesEncoding, states.SerializeAsString()};
  ASSERT_TRUE(journal_->AddFinished("s", more, {series}).ok());
  JournalImage image;
  image.id = "front";
  image.object = "cup";
  image.width = 64;
  image.height = 48;
  image.base_from_camera = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  image.measured_base_from_camera = {0.11, 0.2, 0.3, 0.4, 0.5, 0.6};
  image.measured_unix_s = 1.7e9 - 1.0 / 3;
  image.unix_s = 1.7e9;
  image.png = image::EncodePng(std::vector<uint8_t>(64 * 48, 200).data(), 64, 48, 1).value();
  ASSERT_TRUE(journal_->AddImage("s", image).ok());
  JournalImage viewed = image;
  viewed.id = "side";
  JournalView& view = viewed.view.emplace();
  view.eye_m = {0.1, 1.0 / 3, 0.3}, view.at_m = {0, 0.1, 0}, view.up = {0, 0, 2};
  view.base_from_object = {0.3, 0, 0.1, 0, 0, 1.0 / 7};
  view.session_time_s = 1.0 / 3;
  view.fx_px = 60.1, view.fy_px = 60.2, view.cx_px = 31.5, view.cy_px = 23.5;
  view.distortion = {-0.2, 1.0 / 9};
  ASSERT_TRUE(journal_->AddImage("s", viewed).ok());

  const std::string path = folder_ + "/session.h5";
  const absl::Status exported = ExportSessionHdf5(*journal_, "s", path);
  ASSERT_TRUE(exported.ok()) << exported;
  options_.session = "again";
  const absl::Status imported = Add(ReadSessionHdf5(path, options_));
  ASSERT_TRUE(imported.ok()) << imported;
  const auto touches = [&](const std::string& session) {
    std::vector<JournalTouch> all;
    EXPECT_TRUE(journal_
                    ->ForEachTouch(session,
                                   [&](const JournalTouch& touch) {
                                     all.push_back(touch);
                                     return true;
                                   })
                    .ok());
    return all;
  };
  const auto again = journal_->Series("again", "with poses"),
             none = journal_->Series("again", touches("again")[0].id);
  ASSERT_TRUE(again.ok() && again->has_value()) << again.status();
  EXPECT_EQ((*again)->encoding, series.encoding);
  EXPECT_EQ((*again)->columns, series.columns);
  EXPECT_TRUE(none.ok() && !none->has_value());
  const auto before = touches("s"), after = touches("again");
  ASSERT_EQ(before.size(), 4u);
  ASSERT_EQ(after.size(), 4u);
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(after[k].id, before[k].id);
    EXPECT_EQ(after[k].object, before[k].object);
    EXPECT_EQ(after[k].up_face, before[k].up_face);
    EXPECT_EQ(after[k].command, before[k].command);
    EXPECT_EQ(after[k].attempt, before[k].attempt);
    EXPECT_EQ(after[k].round, before[k].round);
    EXPECT_EQ(after[k].face, before[k].face);
    EXPECT_EQ(after[k].result.recovered, before[k].result.recovered);
    EXPECT_TRUE(same(after[k].result.speed_m_s, before[k].result.speed_m_s));
    EXPECT_TRUE(same(after[k].result.session_time_s, before[k].result.session_time_s));
    EXPECT_TRUE(same(after[k].result.start_unix_s, before[k].result.start_unix_s));
    EXPECT_TRUE(same(after[k].result.effector_drift, before[k].result.effector_drift));
    ASSERT_EQ(after[k].result.fingers.size(), 3u);
    for (int i = 0; i < 3; ++i) {
      const JournalFinger &a = after[k].result.fingers[i], &b = before[k].result.fingers[i];
      EXPECT_TRUE(same(a.contact_time_s, b.contact_time_s));
      EXPECT_EQ(a.ticks, b.ticks);
      for (int axis = 0; axis < 6; ++axis) EXPECT_TRUE(same(a.base_from_tip[axis], b.base_from_tip[axis]));
    }
  }
  EXPECT_EQ(journal_->Session("again")->provenance, journal_->Session("s")->provenance);
  ASSERT_TRUE(journal_
                  ->ForEachImage("again",
                                 [&](const JournalImage& kept) {
                                   if (kept.id == "side") {
                                     EXPECT_TRUE(kept.view.has_value());
                                     if (!kept.view) return true;
                                     EXPECT_EQ(kept.view->eye_m, view.eye_m);
                                     EXPECT_EQ(kept.view->at_m, view.at_m);
                                     EXPECT_EQ(kept.view->up, view.up);
                                     EXPECT_EQ(kept.view->base_from_object, view.base_from_object);
                                     EXPECT_EQ(kept.view->session_time_s, view.session_time_s);
                                     EXPECT_EQ(kept.view->fx_px, view.fx_px);
                                     EXPECT_EQ(kept.view->cy_px, view.cy_px);
                                     EXPECT_EQ(kept.view->distortion, view.distortion);
                                     return true;
                                   }
                                   EXPECT_EQ(kept.id, "front");
                                   EXPECT_FALSE(kept.view.has_value());
                                   EXPECT_EQ(kept.png, image.png);
                                   EXPECT_EQ(kept.width, 64);
                                   EXPECT_EQ(kept.base_from_camera, image.base_from_camera);
                                   EXPECT_EQ(kept.measured_base_from_camera, image.measured_base_from_camera);
                                   EXPECT_EQ(kept.measured_unix_s, image.measured_unix_s);
                                   return true;
                                 })
                  .ok());
  EXPECT_TRUE(absl::IsAlreadyExists(Add(ReadSessionHdf5(path, options_))));
  EXPECT_TRUE(absl::IsInvalidArgument(Add(ReadSessionHdf5(csv_, options_))));
  EXPECT_FALSE(ExportSessionHdf5(*journal_, "s", folder_ + "/no/session.h5").ok());
}

TEST_F(SessionFiles, ASessionWithoutAResultIsNotExported) {
  JournalSession session;
  session.name = "empty";
  ASSERT_TRUE(journal_->EnsureSession(session).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(ExportSessionCsv(*journal_, "empty", folder_ + "/out.csv")));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/out.csv"));
}

}  // namespace
}  // namespace touchstone::session
