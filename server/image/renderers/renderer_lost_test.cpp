// A graphics device that is reset or gone: the driver here is a real one, and the two functions by which OpenGL and EGL
// tell of it answer for a while as the driver of a lost device does.
#include <atomic>
#include <thread>
#include <vector>

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/image/renderers/test_scene.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

std::atomic<int> resets_to_tell{0};
std::atomic<bool> gone{false};
std::atomic<int> contexts_made{0};
decltype(epoxy_glGetGraphicsResetStatus) driver_reset_status;
decltype(epoxy_eglCreateContext) driver_create_context;

GLenum ResetStatus() {
  if (resets_to_tell > 0) return --resets_to_tell, GL_UNKNOWN_CONTEXT_RESET;
  return driver_reset_status();
}

EGLContext CreateContext(EGLDisplay display, EGLConfig config, EGLContext share, const EGLint* attributes) {
  if (gone) return EGL_NO_CONTEXT;
  ++contexts_made;
  return driver_create_context(display, config, share, attributes);
}

class LostDevice : public testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    renderer_ = RendererNamed("egl", &reason);
    if (renderer_ == nullptr) GTEST_SKIP() << "no egl renderer here: " << reason;
    expected_ = Draw().value().pixels;  // and libepoxy has found the driver's functions
    driver_reset_status = epoxy_glGetGraphicsResetStatus;
    driver_create_context = epoxy_eglCreateContext;
    epoxy_glGetGraphicsResetStatus = ResetStatus;
    epoxy_eglCreateContext = CreateContext;
    resets_to_tell = 0, gone = false, contexts_made = 0;
  }
  void TearDown() override {
    if (renderer_ == nullptr) return;
    renderer_.reset();
    epoxy_glGetGraphicsResetStatus = driver_reset_status;
    epoxy_eglCreateContext = driver_create_context;
  }

  absl::StatusOr<Image> Draw() {
    return renderer_->Render(surface_, CameraAt({0.3, 0.1, 0.1}), WithAll(96, 96));
  }

  const std::shared_ptr<const geometry::Surface> surface_ = MakeSurface("letter", LetterMesh());
  std::shared_ptr<Renderer> renderer_;
  std::vector<uint8_t> expected_;
};

TEST_F(LostDevice, ThatIsBackDrawsTheSameBytesWithANewContext) {
  resets_to_tell = 1;
  const absl::StatusOr<Image> image = Draw();
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->pixels, expected_);
  EXPECT_EQ(resets_to_tell, 0);
  EXPECT_EQ(contexts_made, 1);
}

TEST_F(LostDevice, ThatStaysAwayIsSaidAndTriedAgain) {
  resets_to_tell = 1, gone = true;
  for (int k = 0; k < 2; ++k) {
    const absl::Status status = Draw().status();
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("the graphics device was lost"));
  }
  gone = false;
  const absl::StatusOr<Image> image = Draw();
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->pixels, expected_);
}

TEST_F(LostDevice, ThatIsResetAgainAndAgainIsSaid) {
  resets_to_tell = 2;
  const absl::Status status = Draw().status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("it was reset while it drew"));
}

TEST_F(LostDevice, LeavesNobodyWaiting) {
  std::atomic<int> drawn{0}, refused{0}, other{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&] {
      for (int k = 0; k < 20; ++k) {
        if (k == 5) resets_to_tell = 1, gone = true;
        if (k == 15) gone = false;
        const absl::StatusOr<Image> image = Draw();
        ++(image.ok() && image->pixels == expected_ ? drawn
           : absl::IsUnavailable(image.status())    ? refused
                                                    : other);
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(drawn + refused, 80);
  EXPECT_EQ(other, 0);
  EXPECT_TRUE(Draw().ok());
}

}  // namespace
}  // namespace touchstone::image
