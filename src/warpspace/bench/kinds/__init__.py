"""The tests that come with warpspace, one file each."""
