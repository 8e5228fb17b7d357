"""The test kit: expectors, replayers, fakes and contracts. Students test their robots with it; time is virtual."""
