"""What graded submissions are shown as: pages for people, files for the systems that courses use."""
