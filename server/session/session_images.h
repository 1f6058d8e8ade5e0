// The photographs of a journal's session as an image set (measurement_files.md): as the rig's camera gave them, with the
// lens that it had, the poses in the object's frame as commanded and as measured, and the session's time.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/session/images/image_set.h"
#include "server/session/journal/journal.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::session {

// The files of the set; the pictures' bytes are those of the journal. Views that were taken several times are repeats,
// by `round`; photographs of an emulated rig say so (emulated.h). FAILED_PRECONDITION if there is no photograph, or if
// they are no image set: one without a view (a journal of before version 3), several lenses or sizes, a lens that
// camera.yaml cannot hold, more bytes than a set may have. DATA_LOSS names a picture that is damaged.
absl::StatusOr<v1::ImageSetFiles> SessionImageSetFiles(const Journal& journal, const std::string& session);

}  // namespace touchstone::session
